// Homing: the switch closes at -150 degrees on the way down. A unit that finds it closed goes up until it is open.
#include "homing.h"

#include "../hal/pins.h"
#include "../hal/stepper.h"
#include "bearing.h"
#include "memory.h"
#include "motor.h"
#include "ramp.h"

#define HOME_HALF_STEP (-1699) // the first at or below -150 degrees (-1698.24 half steps)
#define SEARCH_HALF_STEPS (HALF_STEPS_PER_TURN + HALF_STEPS_PER_TURN / 10)
#define CLEAR_HALF_STEPS 32 // past the opening switch's bounce

// Not the plan's speed and ramp: the motor must come to rest between the switch and the cable's end, 15 degrees on.
#define TOP_SPEED 600
#define RAMP_MS 100 // 30 half steps, 2.7 degrees

static __xdata enum { LEAVING, SEEKING } phase;
static __xdata bool seen;

static void search(bool decreasing)
{
    stepper_set_position(0);
    motor_go(decreasing ? -SEARCH_HALF_STEPS : SEARCH_HALF_STEPS);
}

static void seek(void)
{
    phase = SEEKING;
    seen = false;
    stepper_watch_home();
    search(true);
}

void homing_begin(void)
{
    seen = false;
    ramp_set(TOP_SPEED, RAMP_MS);
    if (!pins_home_is_closed()) {
        seek();
        return;
    }
    phase = LEAVING;
    search(false);
}

enum homing_outcome homing_step(void)
{
    bool reached = phase == LEAVING ? !pins_home_is_closed() : stepper_saw_home();
    if (reached && !seen) {
        seen = true;
        motor_end_after(phase == LEAVING ? CLEAR_HALF_STEPS : 0);
    }
    if (motor_is_moving())
        return HOMING_GOES_ON;
    if (!seen)
        return HOMING_FAILED;
    if (phase == LEAVING) {
        seek();
        return HOMING_GOES_ON;
    }
    // The motor went on for its ramp after the switch was seen.
    stepper_set_position(stepper_position() - stepper_home_position() + HOME_HALF_STEP);
    return HOMING_FOUND;
}
