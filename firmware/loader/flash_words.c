// Integers as they lie in flash, which is how SDCC lays them out itself.
#include "flash_words.h"

uint16_t flash_read16(uint16_t address)
{
    return *(const __code uint16_t *)address;
}

uint32_t flash_read32(uint16_t address)
{
    return *(const __code uint32_t *)address;
}
