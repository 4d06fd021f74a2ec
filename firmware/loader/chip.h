// The chip as the loader runs it: on the internal oscillator, without interrupts, and under the watchdog once it stays.
#ifndef LOADER_CHIP_H
#define LOADER_CHIP_H

#include <stdbool.h>

// Takes SYSCLK from the 1.5 MHz of reset to 12 MHz, and touches nothing else.
void chip_start(void);

// Makes flash writable (../hal/flash.h), gives the board its pins, and starts the watchdog for good: it allows 65 ms,
// and an erase takes 20.
void chip_stay(void);

// Whether 65.536 ms have passed since this was last true.
bool chip_has_counted(void);
#define CHIP_COUNTS_PER_S 15

#endif
