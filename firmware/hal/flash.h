// Flash: single bytes are written and pages of 512 bytes erased, as few as possible and before anything else runs.
#ifndef FLASH_H
#define FLASH_H

#include <stdint.h>

#define FLASH_PAGE_BYTES 512

// Clears those bits of a byte that are 0 in `value`. Interrupts must be off, the VDD monitor on, and the watchdog off.
void flash_write(uint16_t address, uint8_t value);

// Sets every bit of the page at `address`; stops the CPU for some 15 ms. Under the same conditions.
void flash_erase(uint16_t address);

uint8_t flash_read(uint16_t address);

#endif
