// The frames of the unit's answers, field by field as in the table of ../README.md.
#include "answer.h"

#include "../hal/reset.h"
#include "../hal/timebase.h"
#include "../hal/uart.h"
#include "bearing.h"
#include "cobs.h"
#include "counters.h"
#include "crc.h"
#include "memory.h"
#include "motor.h"
#include "protocol.h"
#include "ring.h"
#include "settings.h"
#include "unit.h"
#include "version.h"

#define LONGEST_FRAME 40 // STATUS

static __xdata uint8_t frame[LONGEST_FRAME];
static __xdata uint8_t length;
static __xdata uint16_t this_boot;

static void put8(uint8_t value)
{
    frame[length++] = value;
}

static void put16(uint16_t value)
{
    put8((uint8_t)value);
    put8(value >> 8);
}

static void put32(uint32_t value)
{
    put16((uint16_t)value);
    put16(value >> 16);
}

static void put_tick(uint32_t tick)
{
    put32(tick);
    put16(timebase_high(tick));
}

static void begin(uint8_t type)
{
    length = 0;
    put8(type);
}

static void end(void)
{
    uint32_t crc = CRC_EMPTY;
    for (uint8_t i = 0; i < length; i++)
        crc = crc_add(crc, frame[i]);
    put32(crc_end(crc));
    cobs_encode_begin(frame, length, frame, frame + sizeof frame);
}

void answer_start(uint16_t boot)
{
    this_boot = boot;
}

void answer_hello(uint8_t request)
{
    begin(FRAME_HELLO_ANSWER);
    put8(request);
    put8(PROTOCOL_VERSION);
    put32(settings_serial());
    put8(VERSION_MAJOR);
    put8(VERSION_MINOR);
    put8(VERSION_PATCH);
    put16(this_boot);
    put8(reset_cause());
    put8(0);
    put16(RING_CAPACITY);
    end();
}

void answer_status(uint8_t request)
{
    begin(FRAME_STATUS_ANSWER);
    put8(request);
    put8(unit_state());
    put8(unit_flags());
    put8(unit_fault());
    put16(unit_waypoint());
    put16(bearing_of_half_step(motor_half_step()));
    put16(ring_used());
    put8(ring_frames());
    put32(counters.sweeps_made);
    put16(counters.sweeps_resent);
    put16(counters.frames_bad);
    put16(counters.frames_unknown);
    put16(uart_bytes_lost());
    put16(counters.echo_faults);
    put16(TEMPERATURE_NOT_MEASURED);
    put8(0);
    put_tick(timebase_now());
    end();
}

void answer_clock(uint8_t request, uint32_t received, uint32_t sent)
{
    begin(FRAME_CLOCK_ANSWER);
    put8(request);
    put_tick(received);
    put_tick(sent);
    end();
}

void answer_result(uint8_t request, uint8_t command, uint8_t result)
{
    begin(FRAME_RESULT);
    put8(request);
    put8(command);
    put8(result);
    end();
}

void answer_rejected(uint8_t reason, uint8_t type)
{
    begin(FRAME_REJECTED);
    put8(reason);
    put8(type);
    end();
}
