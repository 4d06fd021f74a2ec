// The stack grows upwards to the end of internal memory, 0xFF, and from there on into the registers at 0x00.
#include "stack.h"

#include "chip.h"

#define PAINT 0xA5
#define CANARY 0xFE // two bytes: one may by chance be written with the paint's value

void stack_start(void)
{
    uint8_t at = SP;
    while (++at != 0)
        *(__idata volatile uint8_t *)at = PAINT;
}

bool stack_is_sound(void)
{
    return *(__idata volatile uint8_t *)CANARY == PAINT && *(__idata volatile uint8_t *)(CANARY + 1) == PAINT;
}

uint8_t stack_free(void)
{
    uint8_t at = CANARY;
    while (at != SP && *(__idata volatile uint8_t *)(at - 1) == PAINT)
        at--;
    return CANARY - at;
}
