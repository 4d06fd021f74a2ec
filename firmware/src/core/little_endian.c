// Integers as they lie on the wire and in flash.
#include "little_endian.h"

uint16_t get16(const __xdata uint8_t *bytes)
{
    return bytes[0] | (uint16_t)bytes[1] << 8;
}

uint32_t get32(const __xdata uint8_t *bytes)
{
    return get16(bytes) | (uint32_t)get16(bytes + 2) << 16;
}

void put16(__xdata uint8_t *bytes, uint16_t value)
{
    bytes[0] = (uint8_t)value;
    bytes[1] = value >> 8;
}
