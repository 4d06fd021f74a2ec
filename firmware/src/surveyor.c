// The surveyor's end. A press takes the next waypoint and sweeps once, a double press takes the last waypoint back.
#include "surveyor.h"

#include <stdbool.h>
#include <stdint.h>

#include "../hal/pins.h"
#include "core/gesture.h"
#include "core/protocol.h"
#include "unit.h"

static bool is_ready(void)
{
    uint8_t state = unit_state();
    return state == STATE_IDLE || state == STATE_FAULT;
}

static void follow(enum gesture gesture)
{
    uint16_t waypoint = unit_waypoint();
    if (gesture == GESTURE_PRESS) {
        unit_set_waypoint(waypoint + 1); // WAYPOINT_NONE + 1 is 0, the first
        unit_single();
    } else if (waypoint != WAYPOINT_NONE) {
        unit_set_waypoint(waypoint - 1);
    }
}

void surveyor_start(void)
{
    gesture_start(pins_button_is_pressed());
}

void surveyor_task(void)
{
    enum gesture gesture = gesture_sample(pins_button_is_pressed());
    if (gesture != GESTURE_NONE && is_ready())
        follow(gesture);
    pins_set_led(unit_state() == STATE_IDLE);
}
