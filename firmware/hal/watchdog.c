// The watchdog: PCA module 4 (datasheet chapter "Programmable Counter Array").
#include "watchdog.h"

#include "chip.h"

void watchdog_start(void)
{
    PCA0CPL4 = 0xFF; // the longest time-out: 65,280 to 65,536 ticks
    PCA0MD |= PCA0MD_WDTE; // not locked: it must be stopped when flash is erased, and a lock lasts until the next reset
    watchdog_feed();
}

void watchdog_stop(void)
{
    PCA0MD &= ~PCA0MD_WDTE;
}

void watchdog_feed(void)
{
    PCA0CPH4 = 0; // any write restarts the time-out
}
