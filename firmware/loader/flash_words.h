// Integers as they lie in flash: the lowest byte first.
#ifndef FLASH_WORDS_H
#define FLASH_WORDS_H

#include <stdint.h>

uint16_t flash_read16(uint16_t address);
uint32_t flash_read32(uint16_t address);

#endif
