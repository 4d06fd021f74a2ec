// Moves: plans each half step's interval a few half steps ahead of the interrupt that makes them.
#include "motor.h"

#include "../hal/stepper.h"
#include "ramp.h"

static uint16_t to_go; // half steps not planned yet
static uint16_t level; // half steps that it would take to stop
static uint16_t interval_us;

void motor_go(int16_t half_step)
{
    int16_t distance = half_step - stepper_position();
    stepper_set_direction(distance < 0);
    to_go = distance < 0 ? -distance : distance;
    level = 0;
    interval_us = RAMP_SLOWEST_US;
}

void motor_end_after(uint16_t half_steps)
{
    uint16_t shortest = half_steps < level ? level : half_steps;
    if (shortest < to_go)
        to_go = shortest;
}

bool motor_is_moving(void)
{
    return stepper_is_turning() || to_go != 0;
}

static void plan_half_step(void)
{
    if (to_go <= level)
        interval_us = ramp_interval_us(level = to_go);
    else if (level == 0 || interval_us > ramp_cruise_us())
        interval_us = ramp_interval_us(++level);
    stepper_push(interval_us);
    to_go--;
}

void motor_task(void)
{
    while (to_go != 0 && stepper_has_room())
        plan_half_step();
}
