// What comes in from the host. What cannot be read is counted and rejected, and the next 0x00 begins anew.
#include "receive.h"

#include <stdbool.h>
#include <stdint.h>

#include "../hal/uart.h"
#include "cobs.h"
#include "command.h"
#include "counters.h"
#include "crc.h"
#include "delivery.h"
#include "little_endian.h"
#include "memory.h"
#include "protocol.h"
#include "transmit.h"

#define SHORTEST_FRAME (1 + CRC_BYTES)
#define LONGEST_FRAME (16 + CRC_BYTES) // CONFIGURE

static __xdata uint8_t frame[LONGEST_FRAME];
static __xdata uint8_t length;
static __xdata bool is_empty;
static __xdata bool is_too_long;

void receive_start(void)
{
    cobs_decode_begin();
    length = 0;
    is_empty = true;
    is_too_long = false;
}

static void take_byte(uint8_t encoded)
{
    int16_t byte = cobs_decode(encoded);
    is_empty = false;
    if (byte == COBS_NOTHING)
        return;
    if (length < LONGEST_FRAME)
        frame[length++] = (uint8_t)byte;
    else
        is_too_long = true;
}

// Why the frame cannot be taken, or REASON_NONE when it was.
static uint8_t take_frame(uint32_t received)
{
    if (is_too_long)
        return REASON_TOO_LONG;
    if (!cobs_decode_is_complete() || length < SHORTEST_FRAME)
        return REASON_UNREADABLE;
    uint8_t content = length - CRC_BYTES;
    uint32_t crc = CRC_EMPTY;
    for (uint8_t i = 0; i < content; i++)
        crc = crc_add(crc, frame[i]);
    crc = crc_end(crc);
    if (crc != get32(frame + content))
        return REASON_UNREADABLE;
    delivery_host_is_heard();
    return command_take(frame, content, crc, received);
}

static void reject(uint8_t reason)
{
    if (reason == REASON_UNKNOWN_TYPE)
        counters.frames_unknown++;
    else
        counters.frames_bad++;
    transmit_rejected(reason, reason == REASON_UNREADABLE ? 0 : frame[0]);
}

static void end_frame(uint32_t received)
{
    uint8_t reason = is_empty ? REASON_NONE : take_frame(received);
    if (reason != REASON_NONE)
        reject(reason);
    receive_start();
}

void receive_task(void)
{
    while (uart_has_byte() && transmit_is_free()) {
        uint8_t byte = uart_take();
        if (byte != COBS_DELIMITER)
            take_byte(byte);
        else
            end_frame(uart_take_stamp());
    }
}
