// A page's image in memory, and a page of flash that is made to hold it.
#ifndef PAGE_H
#define PAGE_H

#include <stdbool.h>
#include <stdint.h>

#include "../hal/flash.h"

extern __xdata uint8_t page_image[FLASH_PAGE_BYTES];

// Fills the image from flash.
void page_load(uint16_t address);

uint32_t page_crc(void);

// Erases the page at `address`, alone between two feedings of the watchdog: it takes up to 20 ms of the 65.
void page_erase(uint16_t address);

// Makes the page at `address` hold the image; false if the flash does not take it. A page that holds it already is
// left alone. Flash must be writable (../hal/flash.h).
bool page_program(uint16_t address);

#endif
