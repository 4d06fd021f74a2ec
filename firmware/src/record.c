// Sweeps in the ring, laid out as SWEEP frames.
#include "record.h"

#include "../hal/timebase.h"
#include "core/check.h"
#include "core/memory.h"
#include "core/protocol.h"
#include "core/ring.h"
#include "counters.h"
#include "life.h"
#include "settings.h"
#include "thermometer.h"

#define OFFSET_NAME 1
#define OFFSET_SERIAL 7
#define OFFSET_COUNT 26
#define HEADER_BYTES 27
#define NAME_2_BYTES 6 // boot and sequence: all that a sweep of protocol 2 is named by
#define READING_BYTES 8
#define TICKS_PER_OFFSET_UNIT_LOG2 4
#define LONGEST_OFFSET 0xFFFFFFUL

static __xdata uint16_t this_boot;
static __xdata uint32_t sweep_start;
static __xdata uint8_t readings;

static void put16(uint16_t value)
{
    ring_put((uint8_t)value);
    ring_put(value >> 8);
}

static void put24(uint32_t value)
{
    put16((uint16_t)value);
    ring_put((uint8_t)(value >> 16));
}

static void put32(uint32_t value)
{
    put16((uint16_t)value);
    put16(value >> 16);
}

void record_start(uint16_t boot)
{
    this_boot = boot;
    ring_recover();
}

bool record_has_room(uint8_t count)
{
    return ring_has_room(HEADER_BYTES + (uint16_t)count * READING_BYTES);
}

void record_begin(uint32_t start, uint16_t waypoint, bool decreasing)
{
    sweep_start = start;
    readings = 0;
    ring_begin();
    ring_put(FRAME_SWEEP);
    put16(this_boot);
    put32(counters.sweeps_made);
    put32(settings_serial());
    put32(life_number());
    put32(start);
    put16(timebase_high(start));
    put16(waypoint);
    put16(thermometer_air());
    ring_put((decreasing ? SWEEP_DECREASING : 0) | check_sweep_flags());
    ring_put(0);
}

void record_reading(int16_t bearing, uint32_t triggered, uint32_t echo)
{
    uint32_t offset = (triggered - sweep_start) >> TICKS_PER_OFFSET_UNIT_LOG2;
    put16(bearing);
    put24(offset < LONGEST_OFFSET ? offset : LONGEST_OFFSET);
    put24(echo);
    readings++;
}

bool record_finish(void)
{
    ring_amend(OFFSET_COUNT, readings);
    if (!ring_commit())
        return false;
    counters.sweeps_made++;
    check_count_sweep();
    return true;
}

bool record_is_own(void)
{
    if (ring_oldest_byte(0) == FRAME_SWEEP_2)
        return true;
    uint32_t serial = settings_serial();
    for (uint8_t i = 0; i < sizeof serial; i++) {
        if (ring_oldest_byte(OFFSET_SERIAL + i) != (uint8_t)serial)
            return false;
        serial >>= 8;
    }
    return true;
}

bool record_acknowledge(const __xdata uint8_t *name, uint8_t bytes)
{
    if (!ring_has_oldest() || bytes != (ring_oldest_byte(0) == FRAME_SWEEP_2 ? NAME_2_BYTES : RECORD_NAME_BYTES))
        return false;
    for (uint8_t i = 0; i < bytes; i++)
        if (ring_oldest_byte(OFFSET_NAME + i) != name[i])
            return false;
    ring_drop_oldest();
    return true;
}
