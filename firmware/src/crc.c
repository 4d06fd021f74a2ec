// CRC-16/XMODEM without a table: the eight shifts of a byte folded into four exclusive ors.
#include "crc.h"

uint16_t crc_add(uint16_t crc, uint8_t byte)
{
    uint8_t high = (crc >> 8) ^ byte;
    high ^= high >> 4;
    // high times x^12 + x^5 + 1, the polynomial's lower terms
    return (uint16_t)((crc << 8) ^ ((uint16_t)high << 12) ^ ((uint16_t)high << 5) ^ high);
}
