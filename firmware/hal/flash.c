// Flash (datasheet chapter "Flash Memory"): each operation is a MOVX, unlocked by two keys.
#include "flash.h"

#include "chip.h"

static void operate(uint16_t address, uint8_t value, uint8_t mode)
{
    FLKEY = 0xA5;
    FLKEY = 0xF1;
    PSCTL = mode; // from here on any MOVX would go to flash: this file's are the only one
    *(__xdata volatile uint8_t *)address = value;
    PSCTL = 0;
}

void flash_write(uint16_t address, uint8_t value)
{
    operate(address, value, PSCTL_PSWE);
}

void flash_erase(uint16_t address)
{
    operate(address, 0, PSCTL_PSWE | PSCTL_PSEE);
}

uint8_t flash_read(uint16_t address)
{
    return *(const __code uint8_t *)address;
}
