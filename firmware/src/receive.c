// What comes in from the host. What cannot be read is counted and rejected, and the next 0x00 begins a new frame.
#include "receive.h"

#include <stdint.h>

#include "../hal/uart.h"
#include "command.h"
#include "core/cobs.h"
#include "core/incoming.h"
#include "core/protocol.h"
#include "counters.h"
#include "delivery.h"
#include "transmit.h"

void receive_start(void)
{
    incoming_begin();
}

static void reject(uint8_t reason)
{
    if (reason == REASON_UNKNOWN_TYPE)
        counters.frames_unknown++;
    else
        counters.frames_bad++;
    transmit_rejected(reason, reason == REASON_UNREADABLE ? 0 : incoming.frame[0]);
}

static void end_frame(uint32_t received)
{
    if (!incoming_is_empty()) {
        uint8_t reason = incoming_end();
        if (reason == REASON_NONE) {
            delivery_host_is_heard();
            reason = command_take(incoming.frame, incoming.length, incoming.crc, received);
        }
        if (reason != REASON_NONE)
            reject(reason);
    }
    incoming_begin();
}

void receive_task(void)
{
    while (uart_has_byte() && transmit_is_free()) {
        uint8_t byte = uart_take();
        if (byte != COBS_DELIMITER)
            incoming_take(byte);
        else
            end_frame(uart_take_stamp());
    }
}
