// The settings page: `magic:u16 version:u8 length:u8 generation:u16 serial:u32 crc:u32`, the CRC over what is before it.
#include "settings.h"

#include "../hal/flash.h"
#include "crc.h"
#include "protocol.h"

#define PAGE 0xF600
#define MAGIC 0x4E43
#define VERSION 2
#define HEADER_BYTES 4
#define LEAST_BYTES 6

static uint16_t read16(uint16_t address)
{
    return flash_read(address) | (uint16_t)flash_read(address + 1) << 8;
}

static uint32_t read32(uint16_t address)
{
    return read16(address) | (uint32_t)read16(address + 2) << 16;
}

uint32_t settings_serial(void)
{
    uint8_t length = flash_read(PAGE + 3);
    uint16_t end = PAGE + HEADER_BYTES + length;
    uint32_t crc = CRC_EMPTY;
    if (read16(PAGE) != MAGIC || flash_read(PAGE + 2) != VERSION || length < LEAST_BYTES)
        return SERIAL_NONE;
    for (uint16_t address = PAGE; address != end; address++)
        crc = crc_add(crc, flash_read(address));
    if (crc_end(crc) != read32(end))
        return SERIAL_NONE;
    return read32(PAGE + 6);
}
