// CRC-16/XMODEM: polynomial 0x1021, initial value 0, nothing reflected (Python's binascii.crc_hqx).
#ifndef CRC_H
#define CRC_H

#include <stdint.h>

// The CRC of the bytes so far and one more; the CRC of no bytes is 0.
uint16_t crc_add(uint16_t crc, uint8_t byte);

#endif
