// The calibration: what was measured of this very unit's gears and home.
#ifndef CALIBRATION_H
#define CALIBRATION_H

#include <stdbool.h>
#include <stdint.h>

#include "memory.h"

enum home { HOME_SWITCH, HOME_STOP, HOME_OPENING_SWITCH };

struct calibration {
    uint32_t half_steps_per_turn; // 1/256 half step
    uint8_t backlash; // half steps
    uint8_t home; // enum home
    int16_t home_bearing; // 1/65536 turn
};

extern const __code struct calibration calibration_default;

// Whether a unit can be like that (the limits of CALIBRATE in ../../README.md).
bool calibration_is_possible(const __xdata struct calibration *calibration);

#endif
