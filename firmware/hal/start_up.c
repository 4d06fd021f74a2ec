// What runs before anything else, in loader and application: the compiler's start-up calls it before it clears memory,
// which takes longer than the 2 ms that the watchdog of reset allows.
#include <stdint.h>

#include "supply.h"
#include "watchdog.h"

uint8_t _sdcc_external_startup(void)
{
    supply_guard();
    watchdog_stop();
    return 0;
}
