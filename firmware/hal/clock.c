// The system clock: the 12 MHz internal oscillator times four (datasheet chapters "Oscillators" and
// "Flash Memory").
#include "clock.h"

#include "chip.h"

#define SYSCLK_PER_US 48
#define SYSCLK_PER_PASS 6 // fewer than any compiler can make the loop below take, so that the wait is never shorter

void clock_wait_us(uint8_t microseconds)
{
    while (microseconds-- != 0)
        for (volatile uint8_t pass = SYSCLK_PER_US / SYSCLK_PER_PASS; pass != 0; pass--)
            ;
}

void clock_start(void)
{
    OSCICN = OSCICN_12_MHZ;

    CLKMUL = 0;
    CLKMUL |= CLKMUL_MULEN;
    clock_wait_us(5); // longer still at today's slow clock
    CLKMUL |= CLKMUL_MULINIT;
    while (!(CLKMUL & CLKMUL_MULRDY))
        ;

    FLSCL = FLSCL_FOSE | FLSCL_FLRT; // flash must be read for 48 MHz before the clock is
    PFE0CN = PFE0CN_PFEN;
    CLKSEL = CLKSEL_4X;
}
