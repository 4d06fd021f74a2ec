// The CPU itself (datasheet chapter "CIP-51").
#include "cpu.h"

#include "chip.h"

void cpu_allow_interrupts(void)
{
    EA = 1;
}

void cpu_sleep(void)
{
    PCON |= PCON_IDLE;
    PCON = PCON; // the datasheet asks for an instruction of two bytes or more next
}
