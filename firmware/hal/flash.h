// Flash: single bytes are written and pages of 512 bytes erased, as few as possible, and none while the supply is too
// low (supply.h): who needs to know reads what has been written.
#ifndef FLASH_H
#define FLASH_H

#include <stdint.h>

#define FLASH_PAGE_BYTES 512

uint8_t flash_read(uint16_t address);
uint16_t flash_read16(uint16_t address);
uint32_t flash_read32(uint16_t address);

// Clears those bits of a byte, or of two, that are 0 in `value`; stops the CPU for some 55 us a byte.
void flash_write(uint16_t address, uint8_t value);
void flash_write16(uint16_t address, uint16_t value);

// Sets every bit of the page at `address`. Stops the CPU for 10 to 20 ms, longer than the watchdog allows.
void flash_erase(uint16_t address);

#endif
