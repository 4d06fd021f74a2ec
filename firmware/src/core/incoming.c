// The frame that comes in.
#include "incoming.h"

#include "cobs.h"
#include "little_endian.h"
#include "protocol.h"

#define SHORTEST (1 + CRC_BYTES)

__xdata struct incoming incoming;
static __xdata bool is_empty;
static __xdata bool is_too_long;

void incoming_begin(void)
{
    cobs_decode_begin();
    incoming.length = 0;
    is_empty = true;
    is_too_long = false;
}

void incoming_take(uint8_t encoded)
{
    int16_t byte = cobs_decode(encoded);
    is_empty = false;
    if (byte == COBS_NOTHING)
        return;
    if (incoming.length < INCOMING_LONGEST)
        incoming.frame[incoming.length++] = (uint8_t)byte;
    else
        is_too_long = true;
}

bool incoming_is_empty(void)
{
    return is_empty;
}

uint8_t incoming_end(void)
{
    if (is_too_long)
        return REASON_TOO_LONG;
    if (!cobs_decode_is_complete() || incoming.length < SHORTEST)
        return REASON_UNREADABLE;
    incoming.length -= CRC_BYTES;
    uint32_t crc = CRC_EMPTY;
    for (uint8_t i = 0; i < incoming.length; i++)
        crc = crc_add(crc, incoming.frame[i]);
    incoming.crc = crc_end(crc);
    return incoming.crc == get32(incoming.frame + incoming.length) ? REASON_NONE : REASON_UNREADABLE;
}
