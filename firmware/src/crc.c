// CRC-32 by a table of half bytes: 64 bytes of code, for the loader has few.
#include "crc.h"

#include "memory.h"

// x^32 times each half byte modulo the polynomial 0x04C11DB7, all of it bit-reversed.
static const __code uint32_t remainders[16] = {
    0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4, 0x4DB26158, 0x5005713C,
    0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C, 0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C,
};

uint32_t crc_add(uint32_t running, uint8_t byte)
{
    running = (running >> 4) ^ remainders[((uint8_t)running ^ byte) & 0x0F];
    return (running >> 4) ^ remainders[((uint8_t)running ^ (byte >> 4)) & 0x0F];
}

uint32_t crc_end(uint32_t running)
{
    return ~running;
}
