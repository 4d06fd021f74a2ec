// The ring of frames that wait in XRAM until they are acknowledged.
#include "ring.h"

#include "crc.h"

#define RING_BYTES (RING_BLOCKS * RING_BLOCK_BYTES)
#define HEADER_BYTES 3
#define MARK_FRAME 0x5A
#define MARK_DROPPED 0xA5

// The top of XRAM; the Makefile keeps the compiler's own variables below (XRAM_SIZE).
static volatile __xdata __at(0x0400) struct {
    uint8_t magic[4];
    uint8_t oldest; // block numbers
    uint8_t next;
} control;
static __xdata __at(0x040C) uint8_t memory[RING_BYTES];

static const __code uint8_t magic[4] = {'N', 'o', 'c', '2'};

static uint8_t frames;
static __xdata uint16_t written; // bytes of the slot in the making, header included

static __xdata uint8_t *locate(uint8_t block, uint16_t offset)
{
    uint16_t at = (uint16_t)block * RING_BLOCK_BYTES + offset;
    return memory + (at < RING_BYTES ? at : at - RING_BYTES);
}

static uint8_t blocks_for(uint16_t slot_bytes)
{
    return (uint8_t)((slot_bytes + RING_BLOCK_BYTES - 1) / RING_BLOCK_BYTES);
}

static uint8_t blocks_between(uint8_t from, uint8_t to)
{
    return to >= from ? to - from : (uint8_t)(to + RING_BLOCKS - from);
}

static uint8_t block_after(uint8_t block, uint8_t blocks)
{
    return blocks < RING_BLOCKS - block ? block + blocks : (uint8_t)(blocks - (RING_BLOCKS - block));
}

// Content and CRC.
static uint16_t frame_length(uint8_t block)
{
    return *locate(block, 1) | (uint16_t)*locate(block, 2) << 8;
}

static uint8_t slot_blocks(uint8_t block)
{
    return blocks_for(HEADER_BYTES + frame_length(block));
}

static uint32_t crc_of(uint8_t block, uint16_t content_bytes)
{
    const __xdata uint8_t *at = locate(block, HEADER_BYTES);
    const __xdata uint8_t *end = memory + RING_BYTES;
    uint32_t crc = CRC_EMPTY;
    while (content_bytes-- != 0) {
        crc = crc_add(crc, *at);
        if (++at == end)
            at = memory;
    }
    return crc_end(crc);
}

static bool crc_holds(uint8_t block)
{
    uint16_t content = frame_length(block) - CRC_BYTES;
    uint32_t crc = crc_of(block, content);
    for (uint8_t i = 0; i < CRC_BYTES; i++) {
        if (*locate(block, HEADER_BYTES + content + i) != (uint8_t)crc)
            return false;
        crc >>= 8;
    }
    return true;
}

static void skip_dropped(void)
{
    while (control.oldest != control.next && *locate(control.oldest, 0) == MARK_DROPPED)
        control.oldest = block_after(control.oldest, slot_blocks(control.oldest));
}

void ring_clear(void)
{
    control.oldest = 0;
    control.next = 0;
    for (uint8_t i = 0; i < sizeof magic; i++)
        control.magic[i] = magic[i];
    frames = 0;
    ring_begin();
}

static bool control_is_sound(void)
{
    for (uint8_t i = 0; i < sizeof magic; i++)
        if (control.magic[i] != magic[i])
            return false;
    return control.oldest < RING_BLOCKS && control.next < RING_BLOCKS;
}

static bool holds_frame(uint8_t block)
{
    uint16_t length = frame_length(block);
    return *locate(block, 0) == MARK_FRAME && length > CRC_BYTES && length <= RING_CAPACITY - HEADER_BYTES &&
           slot_blocks(block) <= blocks_between(block, control.next) && crc_holds(block);
}

// Makes a block a slot of its own, with nothing in it.
static void drop(uint8_t block)
{
    *locate(block, 0) = MARK_DROPPED;
    *locate(block, 1) = 0;
    *locate(block, 2) = 0;
}

void ring_sift(void)
{
    frames = 0;
    uint8_t block = control.oldest;
    while (block != control.next) {
        if (holds_frame(block)) {
            frames++;
            block = block_after(block, slot_blocks(block));
        } else {
            drop(block); // its length means nothing either: what comes next is looked for block by block
            block = block_after(block, 1);
        }
    }
    skip_dropped();
}

void ring_recover(void)
{
    if (!control_is_sound()) {
        ring_clear();
        return;
    }
    ring_sift();
    ring_begin();
}

bool ring_has_room(uint16_t length)
{
    uint8_t used = blocks_between(control.oldest, control.next);
    return blocks_for(HEADER_BYTES + length + CRC_BYTES) <= RING_BLOCKS - 1 - used;
}

void ring_begin(void)
{
    written = HEADER_BYTES;
}

void ring_put(uint8_t byte)
{
    *locate(control.next, written) = byte;
    written++;
}

void ring_amend(uint16_t offset, uint8_t byte)
{
    *locate(control.next, HEADER_BYTES + offset) = byte;
}

void ring_commit(void)
{
    uint32_t crc = crc_of(control.next, written - HEADER_BYTES);
    for (uint8_t i = 0; i < CRC_BYTES; i++) {
        ring_put((uint8_t)crc);
        crc >>= 8;
    }
    uint16_t length = written - HEADER_BYTES;
    *locate(control.next, 0) = MARK_FRAME;
    *locate(control.next, 1) = (uint8_t)length;
    *locate(control.next, 2) = length >> 8;
    control.next = block_after(control.next, blocks_for(written));
    frames++;
    ring_begin();
}

uint8_t ring_frames(void)
{
    return frames;
}

uint16_t ring_used(void)
{
    return (uint16_t)blocks_between(control.oldest, control.next) * RING_BLOCK_BYTES;
}

const __xdata uint8_t *ring_oldest(void)
{
    return locate(control.oldest, HEADER_BYTES);
}

uint16_t ring_oldest_length(void)
{
    return frame_length(control.oldest);
}

bool ring_oldest_is_sound(void)
{
    return holds_frame(control.oldest);
}

uint8_t ring_oldest_byte(uint16_t offset)
{
    return *locate(control.oldest, HEADER_BYTES + offset);
}

void ring_drop_oldest(void)
{
    control.oldest = block_after(control.oldest, slot_blocks(control.oldest));
    frames--;
    skip_dropped();
}

const __xdata uint8_t *ring_memory(void)
{
    return memory;
}

const __xdata uint8_t *ring_memory_end(void)
{
    return memory + RING_BYTES;
}
