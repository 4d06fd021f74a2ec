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
