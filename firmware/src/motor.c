// Moves: plans each half step's interval a few half steps ahead of the interrupt that makes them.
#include "motor.h"

#include "../hal/stepper.h"
#include "core/backlash.h"
#include "core/ramp.h"

#define MOST_AT_ONCE 8 // half steps of the same interval; more would make a move that is ended late to end

static uint16_t to_go; // half steps not planned yet
static uint16_t level; // half steps that it would take to stop
static uint16_t interval_us;
static __xdata uint8_t at_once; // half steps at top speed

void motor_turn(int16_t half_steps)
{
    stepper_set_direction(half_steps < 0);
    to_go = half_steps < 0 ? -half_steps : half_steps;
    level = 0;
    interval_us = RAMP_SLOWEST_US;
    at_once = ramp_cruise_us() > STEPPER_LONGEST_TOGETHER_US ? 1 : MOST_AT_ONCE;
}

void motor_go(int16_t half_step)
{
    int16_t position = stepper_position();
    motor_turn(backlash_motor(position, half_step) - position);
}

int16_t motor_half_step(void)
{
    return backlash_sensor(stepper_position());
}

void motor_set_half_step(int16_t half_step)
{
    stepper_set_position(backlash_motor_after_fall(half_step));
}

void motor_end_after(uint16_t half_steps)
{
    uint16_t shortest = half_steps < level ? level : half_steps;
    if (shortest < to_go)
        to_go = shortest;
}

bool motor_is_moving(void)
{
    if (to_go != 0)
        return true;
    return stepper_is_turning();
}

static void plan_half_steps(void)
{
    uint8_t half_steps = 1;
    if (to_go <= level) {
        interval_us = ramp_interval_us(level = to_go);
    } else if (level == 0 || interval_us > ramp_cruise_us()) {
        interval_us = ramp_interval_us(++level);
    } else {
        uint16_t at_top_speed = to_go - level;
        half_steps = at_top_speed < at_once ? at_top_speed : at_once;
    }
    stepper_push(interval_us, half_steps);
    to_go -= half_steps;
}

void motor_task(void)
{
    while (to_go != 0 && stepper_has_room())
        plan_half_steps();
}
