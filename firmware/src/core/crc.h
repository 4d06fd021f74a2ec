// CRC-32 (IEEE 802.3, zlib's crc32), byte by byte.
#ifndef CRC_H
#define CRC_H

#include <stdint.h>

#define CRC_BYTES 4
#define CRC_EMPTY 0xFFFFFFFFUL

// The running value of the bytes so far and one more; that of no bytes is CRC_EMPTY.
uint32_t crc_add(uint32_t running, uint8_t byte);

// The CRC of all bytes so far.
uint32_t crc_end(uint32_t running);

#endif
