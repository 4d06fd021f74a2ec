// CRC-32 as in ../src/crc.h, with the running value in internal memory: the chip takes that several times as fast, and
// the loader has the whole application to look through before each start.
#ifndef CHECKSUM_H
#define CHECKSUM_H

#include <stdint.h>

#define CHECKSUM_BYTES 4
#define CHECKSUM_OF_SOUND 0x2144DF1CUL // what comes out when bytes and their own CRC are taken in

// One at a time.
void checksum_begin(void);
void checksum_add(uint8_t byte);

// The CRC of the bytes since checksum_begin().
uint32_t checksum(void);

// The CRC of `length` bytes of flash. The watchdog is fed meanwhile.
uint32_t checksum_of_flash(uint16_t address, uint16_t length);

#endif
