// Homing. The switch closes on the way down (or opens, if it is a normally-closed one, so that a broken wire reads as
// home and never winds up the cable); a unit that finds it so goes up until it is not. An end stop is felt
// by nobody: the motor turns down so far that it has met it wherever it came from, and so slowly that it may.
#include "homing.h"

#include <stdbool.h>
#include <stdint.h>

#include "../hal/pins.h"
#include "../hal/stepper.h"
#include "core/bearing.h"
#include "core/check.h"
#include "core/ramp.h"
#include "motor.h"

#define CLEAR_HALF_STEPS 32 // past the switch's bounce
#define LOOKS 3 // rounds in a row that must find the unit away from its switch

// Not the plan's speed and ramp: the motor must come to rest between the switch and the cable's end, 15 degrees on.
#define TOP_SPEED 600
#define RAMP_MS 100 // 30 half steps, 2.7 degrees

// The rotor falls back by a period of the coils each time that it slips: slowly, it does so without a blow.
#define TOP_SPEED_AGAINST_STOP 250

static __xdata enum { LEAVING_SWITCH, SEEKING_SWITCH, SEEKING_STOP } phase;
static const __xdata struct calibration *__xdata calibration;
static __xdata bool seen;
static __xdata uint8_t looks_away; // rounds in a row
static __xdata int16_t closed_at; // half step of the motor
static __xdata int16_t slip; // of the bearings before, in half steps

static int16_t turn(void)
{
    return (int16_t)(calibration->half_steps_per_turn >> 8);
}

static void search(int16_t half_steps)
{
    seen = false;
    looks_away = 0;
    motor_turn(half_steps);
}

static bool is_at_switch(void)
{
    return pins_home_is_closed() != (calibration->home == HOME_OPENING_SWITCH);
}

static void leave_switch(void)
{
    phase = LEAVING_SWITCH;
    search(turn() / 4);
}

static void seek_switch(void)
{
    phase = SEEKING_SWITCH;
    stepper_watch_home(calibration->home == HOME_OPENING_SWITCH);
    search(-turn() - turn() / 10);
}

// Ends in the same phase of the coils every time, and so leaves the rotor in the same place.
static void seek_stop(bool homed)
{
    int16_t down = turn();
    if (homed) // an eighth of a turn past where it is expected to be
        down = stepper_position() - bearing_to_half_step(calibration->home_bearing) + down / 8;
    phase = SEEKING_STOP;
    search(-(down / STEPPER_PHASES + 1) * STEPPER_PHASES - stepper_phase());
}

void homing_begin(const __xdata struct calibration *of_unit, bool homed)
{
    calibration = of_unit;
    slip = SLIP_UNKNOWN;
    ramp_set(of_unit->home == HOME_STOP ? TOP_SPEED_AGAINST_STOP : TOP_SPEED, RAMP_MS);
    if (of_unit->home == HOME_STOP)
        seek_stop(homed);
    else if (is_at_switch())
        leave_switch();
    else
        seek_switch();
}

// The first half step at which the switch is found: at its bearing or below.
static int16_t switch_half_step(void)
{
    int16_t nearest = bearing_to_half_step(calibration->home_bearing);
    int16_t above = bearing_of_half_step(nearest) - calibration->home_bearing; // goes round with the bearings
    return above > 0 ? nearest - 1 : nearest;
}

// The motor went on for its ramp after the switch was seen.
void homing_take_switch(int16_t found_at)
{
    motor_set_half_step(stepper_position() - found_at + switch_half_step());
}

static enum homing_outcome leave_step(void)
{
    looks_away = is_at_switch() ? 0 : looks_away + 1;
    if (!seen && looks_away == LOOKS) {
        seen = true;
        motor_end_after(CLEAR_HALF_STEPS);
    }
    if (motor_is_moving())
        return HOMING_GOES_ON;
    if (!seen)
        return HOMING_SWITCH_STAYS_CLOSED;
    seek_switch();
    return HOMING_GOES_ON;
}

static enum homing_outcome switch_step(void)
{
    if (!seen && stepper_saw_home()) {
        seen = true;
        closed_at = stepper_home_position();
        motor_end_after(0);
    }
    if (motor_is_moving())
        return HOMING_GOES_ON;
    if (!seen)
        return HOMING_NO_SWITCH;
    slip = closed_at + calibration->backlash - switch_half_step(); // the sensor came down with the motor
    homing_take_switch(closed_at);
    return HOMING_FOUND;
}

static enum homing_outcome stop_step(void)
{
    if (motor_is_moving())
        return HOMING_GOES_ON;
    motor_set_half_step(bearing_to_half_step(calibration->home_bearing));
    return HOMING_FOUND;
}

int16_t homing_slip(void)
{
    return slip;
}

enum homing_outcome homing_step(void)
{
    switch (phase) {
    case LEAVING_SWITCH:
        return leave_step();
    case SEEKING_SWITCH:
        return switch_step();
    default: // SEEKING_STOP
        return stop_step();
    }
}
