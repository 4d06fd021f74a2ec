// The button's gestures. A press is told apart from the first half of a double press by waiting for the second.
#include "gesture.h"

#include "memory.h"

#define BOUNCE_SAMPLES (20 / GESTURE_SAMPLE_MS)
#define DOUBLE_PRESS_SAMPLES (400 / GESTURE_SAMPLE_MS) // from the first press to the second

static __xdata bool pressed; // without the bounce
static __xdata uint8_t differing; // samples in a row that differ from that
static __xdata uint8_t since_press; // samples since the first press, 0 if there was none

static bool is_press(bool closed)
{
    if (closed == pressed) {
        differing = 0;
        return false;
    }
    differing++;
    if (differing <= BOUNCE_SAMPLES)
        return false;
    differing = 0;
    pressed = closed;
    return pressed;
}

void gesture_start(bool closed)
{
    pressed = closed;
}

enum gesture gesture_sample(bool closed)
{
    bool press = is_press(closed);
    if (since_press == 0) {
        since_press = press;
        return GESTURE_NONE;
    }
    if (press) {
        since_press = 0;
        return GESTURE_DOUBLE_PRESS;
    }
    if (since_press < DOUBLE_PRESS_SAMPLES) {
        since_press++;
        return GESTURE_NONE;
    }
    since_press = 0;
    return GESTURE_PRESS;
}
