// The frame that comes in: byte by byte from COBS, whole and with a sound CRC, or why it is not.
#ifndef INCOMING_H
#define INCOMING_H

#include <stdbool.h>
#include <stdint.h>

#include "crc.h"
#include "memory.h"

#define INCOMING_LONGEST (9 + 16 + CRC_BYTES) // FOR with CONFIGURE

struct incoming {
    uint8_t frame[INCOMING_LONGEST]; // type and payload
    uint8_t length;
    uint32_t crc; // of them
};

extern __xdata struct incoming incoming;

void incoming_begin(void);

// Takes an encoded byte other than the delimiter.
void incoming_take(uint8_t encoded);

// Whether no byte has come: such a frame is nothing.
bool incoming_is_empty(void);

// Takes the delimiter: the enum reason for which the frame is rejected, REASON_NONE if it is not.
uint8_t incoming_end(void);

#endif
