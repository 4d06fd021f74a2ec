// Integers as they lie on the wire and in flash: the lowest byte first.
#ifndef LITTLE_ENDIAN_H
#define LITTLE_ENDIAN_H

#include <stdint.h>

#include "memory.h"

uint16_t get16(const __xdata uint8_t *bytes);
uint32_t get32(const __xdata uint8_t *bytes);

void put16(__xdata uint8_t *bytes, uint16_t value);

#endif
