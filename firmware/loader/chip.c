// The chip as the loader runs it (datasheet chapters "Oscillators", "Reset Sources", "Programmable Counter Array").
#include "chip.h"

#include "../hal/chip.h"
#include "../hal/pins.h"
#include "../hal/reset.h"
#include "../hal/watchdog.h"

void chip_start(void)
{
    OSCICN = OSCICN_12_MHZ;
}

void chip_guard_supply(void)
{
    reset_start();
}

void chip_stay(void)
{
    pins_start();
    reset_start();
    watchdog_start();
}

bool chip_has_counted(void)
{
    if (!CF)
        return false;
    CF = 0;
    return true;
}

void chip_reset(void)
{
    RSTSRC = RSTSRC_SWRSF | RSTSRC_PORSF;
}
