// The plan of a sweep: where it takes its readings, and how the motor goes there.
#ifndef PLAN_H
#define PLAN_H

#include <stdbool.h>
#include <stdint.h>

#include "memory.h"

struct plan {
    int16_t first_bearing; // 1/65536 turn
    uint16_t bearing_step;
    uint8_t count;
    uint16_t ping_interval_ms;
    uint16_t top_speed; // half steps/s
    uint16_t ramp_ms;
    uint16_t settle_ms;
    uint8_t pings; // a reading
};

extern const __code struct plan plan_default;

// Whether a unit can do it (the limits of CONFIGURE in ../../README.md).
bool plan_is_possible(const __xdata struct plan *plan);

// Slows down a plan that is too fast, and gives one whose ramp is too short for its top speed the shortest that does.
// Firmware before 0.6 stored the one, before 0.4 the other.
void plan_ease(__xdata struct plan *plan);

// Whether the sensor may look there: short of its home, and as far on the other side.
bool plan_can_look_at(int16_t bearing);

// The bearing of a reading, counted from 0 in the order of rising bearings.
int16_t plan_bearing(const __xdata struct plan *plan, uint8_t reading);

#endif
