// The supply monitor (datasheet chapter "Reset Sources").
#include "supply.h"

#include <stdint.h>

#include "chip.h"

// 100 us, after which the monitor may be selected, are 150 clocks of 1.5 MHz, the clock of reset; a pass takes six or
// more. Only a power-up turns the monitor off, so it is never turned on at a faster clock.
#define PASSES_TO_SETTLE 30

void supply_guard(void)
{
    if (!(VDM0CN & VDM0CN_VDMEN)) {
        VDM0CN = VDM0CN_VDMEN;
        for (volatile uint8_t pass = PASSES_TO_SETTLE; pass != 0; pass--)
            ;
    }
    RSTSRC = RSTSRC_PORSF; // written whole: reading and writing back would set the bits read as causes
}

bool supply_is_sound(void)
{
    return (VDM0CN & (VDM0CN_VDMEN | VDM0CN_VDDSTAT)) == (VDM0CN_VDMEN | VDM0CN_VDDSTAT);
}
