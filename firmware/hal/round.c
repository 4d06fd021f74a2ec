// The rounds: timer 2 at SYSCLK/12 with automatic reload (datasheet chapter "Timers").
#include "round.h"

#include <stdint.h>

#include "chip.h"
#include "cpu.h"

#define TIMER_CLOCKS_PER_MS 4000
#define RELOAD (65536 - ROUND_MS * TIMER_CLOCKS_PER_MS)

static volatile uint8_t due;
static uint8_t begun;

void round_start(void)
{
    TMR2RL = RELOAD;
    TMR2 = RELOAD;
    TMR2CN = TMR2CN_TR2;
    ET2 = 1;
}

void round_wait(void)
{
    while (begun == due)
        cpu_sleep(); // should the timer run out just before, the next interrupt wakes: a round late, and none is lost
    begun++;
}

void round_isr(void) __interrupt(IRQ_TIMER2)
{
    TF2H = 0;
    due++;
}
