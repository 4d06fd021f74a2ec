// The ring of frames that wait in XRAM until they are acknowledged.
#include "ring.h"

#include "crc.h"

#define RING_BYTES (RING_BLOCKS * RING_BLOCK_BYTES)
#define HEADER_BYTES 3
#define MARK_FRAME 0x5A
#define MARK_DROPPED 0xA5

// The most that ring_seek() or ring_commit() does in one call: it looks at so many blocks, or adds up so many bytes of
// a CRC.
#define BLOCKS_A_CALL 64
#define CRC_BYTES_A_CALL 128

// The top of XRAM; the Makefile keeps the compiler's own variables below (XRAM_SIZE).
static volatile __xdata __at(0x0400) struct {
    uint8_t magic[4];
    uint8_t oldest; // block numbers
    uint8_t next;
} control;
static __xdata __at(0x040C) uint8_t memory[RING_BYTES];

static const __code uint8_t magic[4] = {'N', 'o', 'c', '2'};

// The slot in the making.
static __xdata uint16_t written; // bytes, header included
static __xdata uint16_t summed; // bytes of its content that are in its CRC
static __xdata uint32_t sum;

// How far the CRC of the oldest frame is added up.
static __xdata uint16_t checked; // bytes of its content
static __xdata uint32_t checked_crc;

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

// Goes on with a CRC, by `bytes` from `offset` in the slot.
static uint32_t crc_over(uint32_t crc, uint8_t block, uint16_t offset, uint16_t bytes)
{
    const __xdata uint8_t *at = locate(block, offset);
    const __xdata uint8_t *end = memory + RING_BYTES;
    while (bytes-- != 0) {
        crc = crc_add(crc, *at);
        if (++at == end)
            at = memory;
    }
    return crc;
}

// By its header alone.
static bool looks_like_frame(uint8_t block)
{
    if (*locate(block, 0) != MARK_FRAME)
        return false;
    uint16_t length = frame_length(block);
    return length > CRC_BYTES && length <= RING_CAPACITY - HEADER_BYTES &&
           blocks_for(HEADER_BYTES + length) <= blocks_between(block, control.next);
}

static bool oldest_has_crc(uint32_t crc)
{
    uint16_t at = HEADER_BYTES + frame_length(control.oldest) - CRC_BYTES;
    for (uint8_t i = 0; i < CRC_BYTES; i++) {
        if (*locate(control.oldest, at + i) != (uint8_t)crc)
            return false;
        crc >>= 8;
    }
    return true;
}

static void forget_check(void)
{
    checked = 0;
    checked_crc = CRC_EMPTY;
}

void ring_clear(void)
{
    control.oldest = 0;
    control.next = 0;
    for (uint8_t i = 0; i < sizeof magic; i++)
        control.magic[i] = magic[i];
    forget_check();
    ring_begin();
}

static bool control_is_sound(void)
{
    for (uint8_t i = 0; i < sizeof magic; i++)
        if (control.magic[i] != magic[i])
            return false;
    return control.oldest < RING_BLOCKS && control.next < RING_BLOCKS;
}

void ring_recover(void)
{
    if (!control_is_sound()) {
        ring_clear();
        return;
    }
    forget_check();
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
    summed = 0;
    sum = CRC_EMPTY;
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

bool ring_commit(void)
{
    uint16_t left = written - HEADER_BYTES - summed;
    bool is_last = left <= CRC_BYTES_A_CALL;
    uint16_t bytes = is_last ? left : CRC_BYTES_A_CALL;
    sum = crc_over(sum, control.next, HEADER_BYTES + summed, bytes);
    summed += bytes;
    if (!is_last)
        return false;
    uint32_t crc = crc_end(sum);
    for (uint8_t i = 0; i < CRC_BYTES; i++) {
        ring_put((uint8_t)crc);
        crc >>= 8;
    }
    uint16_t length = written - HEADER_BYTES;
    *locate(control.next, 0) = MARK_FRAME;
    *locate(control.next, 1) = (uint8_t)length;
    *locate(control.next, 2) = length >> 8;
    control.next = block_after(control.next, blocks_for(written));
    ring_begin();
    return true;
}

uint8_t ring_frames(void)
{
    uint8_t frames = 0;
    uint8_t block = control.oldest;
    uint8_t left = blocks_between(block, control.next);
    while (left != 0) {
        uint8_t blocks = 1;
        if (looks_like_frame(block)) {
            blocks = slot_blocks(block);
            frames++;
        }
        block = block_after(block, blocks);
        left -= blocks;
    }
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

uint8_t ring_oldest_byte(uint16_t offset)
{
    return *locate(control.oldest, HEADER_BYTES + offset);
}

bool ring_has_oldest(void)
{
    return control.oldest != control.next && looks_like_frame(control.oldest);
}

// Block by block: the length of what is no frame means nothing. Ends at a frame, at the newest, or after its share.
static void skip_dropped(void)
{
    for (uint8_t left = BLOCKS_A_CALL; left != 0 && control.oldest != control.next; left--) {
        if (looks_like_frame(control.oldest))
            return;
        control.oldest = block_after(control.oldest, 1);
    }
}

// Adds its share of the oldest frame to the CRC; whether that was the last.
static bool check_share(void)
{
    uint16_t content = frame_length(control.oldest) - CRC_BYTES;
    uint16_t left = checked < content ? content - checked : 0; // the length may have been spoiled since the last share
    bool is_last = left <= CRC_BYTES_A_CALL;
    uint16_t bytes = is_last ? left : CRC_BYTES_A_CALL;
    checked_crc = crc_over(checked_crc, control.oldest, HEADER_BYTES + checked, bytes);
    checked += bytes;
    return is_last;
}

bool ring_seek(void)
{
    if (control.oldest == control.next)
        return false;
    if (!looks_like_frame(control.oldest)) {
        forget_check();
        skip_dropped();
        return false;
    }
    if (!check_share())
        return false;
    bool is_sound = oldest_has_crc(crc_end(checked_crc));
    forget_check();
    if (!is_sound)
        ring_drop_oldest();
    return is_sound;
}

void ring_drop_oldest(void)
{
    *locate(control.oldest, 0) = MARK_DROPPED;
}

const __xdata uint8_t *ring_memory(void)
{
    return memory;
}

const __xdata uint8_t *ring_memory_end(void)
{
    return memory + RING_BYTES;
}
