// Walks through the firmware's pure modules and prints what they give, the same under gcc and on an 8051 built by SDCC,
// whose int has 16 bits.
#include "backlash.h"
#include "bearing.h"
#include "calibration.h"
#include "cobs.h"
#include "crc.h"
#include "median.h"
#include "plan.h"
#include "ramp.h"
#include "ring.h"
#include "turns.h"

#ifdef __SDCC
static volatile __xdata __at(0xFFFF) uint8_t simulator; // s51's interface to its host

static void put(char character)
{
    simulator = 'p';
    simulator = character;
}

static void stop(void)
{
    simulator = 's';
    for (;;)
        ;
}
#else
#include <stdio.h>
#include <stdlib.h>

static void put(char character)
{
    putchar(character);
}

static void stop(void)
{
    exit(0);
}
#endif

static void show(const char *name, uint32_t value)
{
    while (*name != '\0')
        put(*name++);
    put(' ');
    for (int8_t shift = 28; shift >= 0; shift -= 4)
        put("0123456789abcdef"[value >> shift & 0xF]);
    put('\n');
}

// A linear congruential generator's upper bytes (Numerical Recipes, 3rd ed., section 7.1).
static uint8_t random_byte(void)
{
    static __xdata uint32_t state;
    state = state * 1664525UL + 1013904223UL;
    return (uint8_t)(state >> 24);
}

static void walk_bearings(void)
{
    for (uint32_t turn = 972800; turn <= 1126400; turn += 51199) {
        bearing_set_turn(turn);
        for (int32_t bearing = -32768; bearing <= 32767; bearing += 499)
            show("half_step", (uint16_t)bearing_to_half_step((int16_t)bearing));
        for (int16_t half_step = -2200; half_step <= 2200; half_step += 31)
            show("bearing", (uint16_t)bearing_of_half_step(half_step));
    }
}

static void walk_backlash(void)
{
    for (uint8_t play = 0; play <= 64; play += 16) {
        backlash_set(play);
        int16_t motor = backlash_motor_after_fall(-1699);
        for (uint8_t move = 0; move < 40; move++) {
            motor = backlash_motor(motor, (int16_t)(random_byte() - 128) * 16);
            show("motor", (uint16_t)motor);
            motor += random_byte() - 128;
            show("sensor", (uint16_t)backlash_sensor(motor));
        }
    }
}

static void walk_calibrations(void)
{
    static __xdata struct calibration calibration;
    calibration = calibration_default;
    show("default", calibration_is_possible(&calibration));
    show("turn", calibration.half_steps_per_turn);
    show("home", (uint16_t)calibration.home_bearing);
    for (uint8_t i = 0; i < 100; i++) {
        calibration.half_steps_per_turn = 950000UL + random_byte() * 1000UL;
        calibration.home_bearing = (int16_t)(random_byte() * -256L);
        show("possible", calibration_is_possible(&calibration));
    }
}

static void walk_medians(void)
{
    for (uint8_t count = 1; count <= 5; count += 2)
        for (uint8_t round = 0; round < 20; round++) {
            median_begin();
            for (uint8_t i = 0; i < count; i++)
                median_add((uint32_t)random_byte() << 16 | random_byte());
            show("median", median_value());
        }
}

static void walk_ramps(void)
{
    for (uint16_t top_speed = 50; top_speed <= 1000; top_speed += 190)
        for (uint16_t ramp_ms = 0; ramp_ms <= 1000; ramp_ms += 250) {
            ramp_set(top_speed, ramp_ms);
            for (uint16_t level = 1; level <= 512; level += 37)
                show("interval", ramp_interval_us(level));
        }
}

static void walk_plans(void)
{
    static __xdata struct plan plan;
    plan = plan_default;
    show("default", plan_is_possible(&plan));
    for (uint8_t reading = 0; reading < plan.count; reading++)
        show("reading", (uint16_t)plan_bearing(&plan, reading));
    for (uint8_t count = 0; count < 70; count++) {
        plan.count = count;
        plan.bearing_step = random_byte() * 16;
        show("possible", plan_is_possible(&plan));
    }
}

static void walk_turns(void)
{
    uint32_t now = 0xFFF00000UL;
    for (uint8_t round = 0; round < 30; round++) {
        uint32_t ahead = (uint32_t)random_byte() << 20 | (uint32_t)random_byte() << 8;
        show("set", turns_set(round % 2 ? now + ahead : now - ahead, 100000UL + 256UL * random_byte(), now));
        for (uint8_t look = 0; look < 40; look++) {
            show("may", turns_may_ping(now));
            turns_task(now);
            now += 8000;
        }
    }
}

// Frames of all lengths go into the ring and come out of it encoded, decoded again on the way.
static void walk_ring(void)
{
    ring_clear();
    for (uint8_t round = 0; round < 40; round++) {
        uint16_t length = 1 + random_byte() + random_byte();
        bool few_zeros = round % 2;
        ring_begin();
        for (uint16_t i = 0; i < length; i++)
            ring_put(few_zeros ? random_byte() | 1 : random_byte() & 3);
        while (!ring_commit())
            ;
        ring_recover();
        while (!ring_seek())
            ;
        cobs_encode_begin(ring_oldest(), ring_oldest_length(), ring_memory(), ring_memory_end());
        cobs_decode_begin();
        uint32_t encoded = CRC_EMPTY;
        uint32_t decoded = CRC_EMPTY;
        for (uint8_t byte = cobs_encode(); byte != COBS_DELIMITER; byte = cobs_encode()) {
            int16_t original = cobs_decode(byte);
            encoded = crc_add(encoded, byte);
            if (original != COBS_NOTHING)
                decoded = crc_add(decoded, (uint8_t)original);
        }
        show("encoded", encoded);
        show("decoded", decoded);
        show("complete", cobs_decode_is_complete());
        show("used", ring_used());
        show("frames", ring_frames());
        if (!ring_has_room(531))
            while (ring_used() != 0)
                if (ring_seek())
                    ring_drop_oldest();
    }
}

int main(void)
{
    walk_bearings();
    walk_backlash();
    walk_calibrations();
    walk_medians();
    walk_ramps();
    walk_plans();
    walk_turns();
    walk_ring();
    stop();
    return 0;
}
