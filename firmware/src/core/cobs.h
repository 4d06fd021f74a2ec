// Consistent overhead byte stuffing (Cheshire and Baker 1999), byte by byte in both directions. One frame at a time is
// encoded, and one decoded.
#ifndef COBS_H
#define COBS_H

#include <stdbool.h>
#include <stdint.h>

#include "memory.h"

#define COBS_DELIMITER 0
#define COBS_NOTHING (-1)

// Begins to encode `length` bytes at `frame`, straight from where they lie: in a circular memory that goes on at
// `memory` when it reaches `memory_end`. They must stay there until the delimiter is out.
void cobs_encode_begin(const __xdata uint8_t *frame, uint16_t length, const __xdata uint8_t *memory,
                       const __xdata uint8_t *memory_end);

// The next encoded byte; the COBS_DELIMITER is the frame's last.
uint8_t cobs_encode(void);

void cobs_decode_begin(void);

// Takes an encoded byte other than the delimiter; gives the decoded byte it brings out, or COBS_NOTHING.
int16_t cobs_decode(uint8_t byte);

// Whether a delimiter may come now; elsewhere it means that bytes were lost.
bool cobs_decode_is_complete(void);

#endif
