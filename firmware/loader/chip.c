// The chip as the loader runs it (datasheet chapters "Oscillators", "Programmable Counter Array").
#include "chip.h"

#include "../hal/chip.h"
#include "../hal/pins.h"
#include "../hal/watchdog.h"

void chip_start(void)
{
    OSCICN = OSCICN_12_MHZ;
}

void chip_stay(void)
{
    pins_start();
    watchdog_start();
}

bool chip_has_counted(void)
{
    if (!CF)
        return false;
    CF = 0;
    return true;
}
