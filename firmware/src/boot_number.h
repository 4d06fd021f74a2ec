// The boot number: counts power-ups and resets in flash, one bit each, so that a page is erased once in 8,128 boots.
#ifndef BOOT_NUMBER_H
#define BOOT_NUMBER_H

#include <stdint.h>

// Counts this boot and returns its number. To be called once, before the watchdog runs.
uint16_t boot_number_count(void);

#endif
