// The ring of frames that wait in XRAM until they are acknowledged. It outlives every reset, as far as its memory does:
// that lies outside what the C start-up clears, and changes only by single bytes, so that no reset finds it half
// changed.
//
// A slot is `mark:u8 length:u16 content crc:u32`, rounded up to whole blocks; the content and its CRC are a frame as it
// goes out, so the one CRC guards it here and on the wire.
#ifndef RING_H
#define RING_H

#include <stdbool.h>
#include <stdint.h>

#include "memory.h"

#define RING_BLOCK_BYTES 12
#define RING_BLOCKS 255 // one stays free, so that a full ring does not look empty
#define RING_CAPACITY ((RING_BLOCKS - 1) * RING_BLOCK_BYTES)

void ring_clear(void);

// Takes up the ring as the last boot left it, or begins with an empty one if there is none.
void ring_recover(void);

// Whether a frame of `length` bytes of content finds room now.
bool ring_has_room(uint16_t length);

// Begins a new slot, in place of one that was not committed; the content follows by ring_put(). The caller asks
// ring_has_room() first. ring_commit() is called, once in a round, until it says that this is the newest frame.
void ring_begin(void);
void ring_put(uint8_t byte);
void ring_amend(uint16_t offset, uint8_t byte); // overwrites a byte of the content
bool ring_commit(void);

// The number of frames, by their headers alone, and the bytes that all slots take up.
uint8_t ring_frames(void);
uint16_t ring_used(void);

// One step towards the oldest frame that is still what was put there; what is not is dropped on the way. Says whether
// it is found. However much is spoiled, one call takes no longer than the CRC of a short frame, so that a round of the
// main loop stays short; in between, frames may be added and dropped.
bool ring_seek(void);

// Whether the oldest slot has the header of a frame.
bool ring_has_oldest(void);

// The oldest frame, once ring_seek() has found it: where it lies, its length with the CRC, a byte of it. It may go on
// from ring_memory_end() at ring_memory().
const __xdata uint8_t *ring_oldest(void);
uint16_t ring_oldest_length(void);
uint8_t ring_oldest_byte(uint16_t offset);

// The next ring_seek() looks for the one after it; its room is free then.
void ring_drop_oldest(void);

const __xdata uint8_t *ring_memory(void);
const __xdata uint8_t *ring_memory_end(void);

#endif
