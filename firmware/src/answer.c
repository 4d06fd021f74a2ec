// The frames of the unit's answers, field by field as in the table of ../README.md.
#include "answer.h"

#include "../hal/reset.h"
#include "../hal/stack.h"
#include "../hal/timebase.h"
#include "../hal/uart.h"
#include "core/bearing.h"
#include "core/check.h"
#include "core/cobs.h"
#include "core/crc.h"
#include "core/memory.h"
#include "core/protocol.h"
#include "core/ring.h"
#include "counters.h"
#include "life.h"
#include "measure.h"
#include "motor.h"
#include "settings.h"
#include "thermometer.h"
#include "unit.h"
#include "version.h"

#define LONGEST_FRAME 40 // STATUS

static __xdata uint8_t frame[LONGEST_FRAME];
static __xdata uint8_t length;
static __xdata uint16_t this_boot;

static void add8(uint8_t value)
{
    frame[length++] = value;
}

static void add16(uint16_t value)
{
    add8((uint8_t)value);
    add8(value >> 8);
}

static void add24(uint32_t value)
{
    add16((uint16_t)value);
    add8(value >> 16);
}

static void add32(uint32_t value)
{
    add16((uint16_t)value);
    add16(value >> 16);
}

static void add_tick(uint32_t tick)
{
    add32(tick);
    add16(timebase_high(tick));
}

static void begin(uint8_t type)
{
    length = 0;
    add8(type);
}

static void end(void)
{
    uint32_t crc = CRC_EMPTY;
    for (uint8_t i = 0; i < length; i++)
        crc = crc_add(crc, frame[i]);
    add32(crc_end(crc));
    cobs_encode_begin(frame, length, frame, frame + sizeof frame);
}

void answer_start(uint16_t boot)
{
    this_boot = boot;
}

void answer_hello(uint8_t request, uint8_t protocol)
{
    begin(FRAME_HELLO_ANSWER);
    add8(request);
    add8(PROTOCOL_VERSION);
    add32(settings_serial());
    add8(VERSION_MAJOR);
    add8(VERSION_MINOR);
    add8(VERSION_PATCH);
    add16(this_boot);
    add8(reset_cause());
    add8(reset_note());
    add16(RING_CAPACITY);
    if (protocol >= PROTOCOL_WITH_LIFE)
        add32(life_number());
    end();
}

void answer_status(uint8_t request)
{
    begin(FRAME_STATUS_ANSWER);
    add8(request);
    add8(unit_state());
    add8(unit_flags());
    add8(unit_fault());
    add16(unit_waypoint());
    add16(bearing_of_half_step(motor_half_step()));
    add16(ring_used());
    add8(ring_frames());
    add32(counters.sweeps_made);
    add16(counters.sweeps_resent);
    add16(counters.frames_bad);
    add16(counters.frames_unknown);
    add16(uart_bytes_lost());
    add16(counters.echo_faults);
    add16(thermometer_chip());
    add8(stack_free());
    add_tick(timebase_now());
    end();
}

void answer_clock(uint8_t request, uint32_t received, uint32_t sent)
{
    begin(FRAME_CLOCK_ANSWER);
    add8(request);
    add_tick(received);
    add_tick(sent);
    end();
}

void answer_settings(uint8_t request)
{
    const __xdata uint8_t *settings = settings_bytes();
    begin(FRAME_SETTINGS_ANSWER);
    add8(request);
    add8(settings_are_stored());
    for (uint8_t i = 0; i < SETTINGS_BYTES; i++)
        add8(settings[i]);
    end();
}

void answer_mechanics(uint8_t request)
{
    int16_t slip = check_slip();
    begin(FRAME_MECHANICS_ANSWER);
    add8(request);
    add16(slip == SLIP_UNKNOWN ? BEARING_UNKNOWN : bearing_of_half_step(slip));
    add8(measured.kind);
    add8(measured.outcome);
    for (uint8_t way = 0; way < 2; way++) {
        add8(measured.edges[way]);
        for (uint8_t i = 0; i < MEASURE_EDGES; i++)
            add16(measured.edge[way][i]);
    }
    add16(measured.top);
    add16(measured.supply);
    add24(measured.lag);
    add24(measured.width);
    end();
}

void answer_result(uint8_t request, uint8_t command, uint8_t result)
{
    begin(FRAME_RESULT);
    add8(request);
    add8(command);
    add8(result);
    end();
}

void answer_rejected(uint8_t reason, uint8_t type)
{
    begin(FRAME_REJECTED);
    add8(reason);
    add8(type);
    end();
}
