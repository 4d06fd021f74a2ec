// Why the chip was reset, and the supply monitor that resets it (datasheet chapter "Reset Sources").
#include "reset.h"

#include "chip.h"
#include "clock.h"

#define VDD_MONITOR_SETTLES_US 100

static __xdata uint8_t cause;

void reset_start(void)
{
    cause = RSTSRC;
    VDM0CN = VDM0CN_VDMEN;
    clock_wait_us(VDD_MONITOR_SETTLES_US); // selected sooner, it would reset the chip
    RSTSRC = RSTSRC_PORSF; // written whole: reading and writing back would set the bits read as causes
}

uint8_t reset_cause(void)
{
    return cause;
}

bool reset_was_power_up(void)
{
    return (cause & RSTSRC_PORSF) != 0;
}
