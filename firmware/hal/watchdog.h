// The watchdog: PCA module 4, which resets the chip when it is not fed for 16.3 ms.
#ifndef WATCHDOG_H
#define WATCHDOG_H

// Starts the watchdog; the timebase must run, since the watchdog freezes its settings.
void watchdog_start(void);

// Stops it, for what takes the CPU longer: the erasing of a flash page.
void watchdog_stop(void);

// To be called from the main loop alone, so that a task that hangs is found out.
void watchdog_feed(void);

#endif
