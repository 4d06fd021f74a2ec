// Everything the unit sends. A frame is encoded straight into the UART's ring, as far as there is room.
#include "transmit.h"

#include "../hal/reset.h"
#include "../hal/timebase.h"
#include "../hal/uart.h"
#include "answer.h"
#include "confirmation.h"
#include "core/cobs.h"
#include "core/memory.h"
#include "core/protocol.h"
#include "delivery.h"
#include "unit.h"

#define CLOCK_LEAD_TICKS (500 * TICKS_PER_US) // longer than it takes to compose a CLOCK answer

static enum { NOTHING, ANSWER, GREETING, SWEEP } going_out;

static __xdata struct {
    uint8_t type; // 0: none waits
    uint8_t request;
    uint8_t subject; // the command of a RESULT, the type that was REJECTED, the protocol of HELLO's host
    uint8_t outcome; // the result or the reason
    uint32_t received; // when the CLOCK request came
} waiting;

static uint8_t farewell; // the enum reset_note of the reset to come

bool transmit_is_free(void)
{
    return waiting.type == 0 && farewell == NOTE_NONE;
}

void transmit_hello(uint8_t request, uint8_t protocol)
{
    waiting.type = FRAME_HELLO_ANSWER;
    waiting.request = request;
    waiting.subject = protocol;
}

void transmit_status(uint8_t request)
{
    waiting.type = FRAME_STATUS_ANSWER;
    waiting.request = request;
}

void transmit_clock(uint8_t request, uint32_t received)
{
    waiting.type = FRAME_CLOCK_ANSWER;
    waiting.request = request;
    waiting.received = received;
}

void transmit_settings(uint8_t request)
{
    waiting.type = FRAME_SETTINGS_ANSWER;
    waiting.request = request;
}

void transmit_mechanics(uint8_t request)
{
    waiting.type = FRAME_MECHANICS_ANSWER;
    waiting.request = request;
}

void transmit_result(uint8_t request, uint8_t command, uint8_t result)
{
    waiting.type = FRAME_RESULT;
    waiting.request = request;
    waiting.subject = command;
    waiting.outcome = result;
}

void transmit_rejected(uint8_t reason, uint8_t type)
{
    waiting.type = FRAME_REJECTED;
    waiting.subject = type;
    waiting.outcome = reason;
}

void transmit_then_reset(uint8_t note)
{
    farewell = note;
}

// A stamp that is sent must be fixed before its own frame is: so the frame is made early and held until then.
static void tell_clock(void)
{
    uint32_t sent = timebase_now() + CLOCK_LEAD_TICKS;
    answer_clock(waiting.request, waiting.received, sent);
    uart_send_at(cobs_encode(), sent);
}

static void begin_answer(void)
{
    switch (waiting.type) {
    case FRAME_HELLO_ANSWER:
        answer_hello(waiting.request, waiting.subject);
        break;
    case FRAME_STATUS_ANSWER:
        answer_status(waiting.request);
        break;
    case FRAME_CLOCK_ANSWER:
        if (!uart_is_silent())
            return;
        tell_clock();
        break;
    case FRAME_SETTINGS_ANSWER:
        answer_settings(waiting.request);
        break;
    case FRAME_MECHANICS_ANSWER:
        answer_mechanics(waiting.request);
        break;
    case FRAME_RESULT:
        answer_result(waiting.request, waiting.subject, waiting.outcome);
        break;
    default:
        answer_rejected(waiting.outcome, waiting.subject);
        break;
    }
    going_out = waiting.type == FRAME_HELLO_ANSWER && waiting.request != REQUEST_NONE ? GREETING : ANSWER;
    waiting.type = 0;
}

static void begin_frame(void)
{
    if (waiting.type != 0) {
        begin_answer();
    } else if (farewell != NOTE_NONE) {
        if (uart_is_silent())
            reset_now(farewell);
    } else if (unit_take_news()) {
        answer_status(REQUEST_NONE);
        going_out = ANSWER;
    } else if (delivery_is_due()) {
        delivery_begin();
        going_out = SWEEP;
    }
}

static void send_encoded(void)
{
    while (going_out != NOTHING && uart_has_room()) {
        uint8_t byte = cobs_encode();
        uart_send(byte);
        if (byte != COBS_DELIMITER)
            continue;
        if (going_out == SWEEP)
            delivery_end();
        else if (going_out == GREETING)
            confirmation_give();
        going_out = NOTHING;
    }
}

void transmit_task(void)
{
    if (going_out == NOTHING)
        begin_frame();
    send_encoded();
}
