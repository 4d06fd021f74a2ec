// The button's gestures: a press, or two in a row.
#ifndef GESTURE_H
#define GESTURE_H

#include <stdbool.h>
#include <stdint.h>

enum gesture { GESTURE_NONE, GESTURE_PRESS, GESTURE_DOUBLE_PRESS };

#define GESTURE_SAMPLE_MS 10

// Says how the contact is when it is first looked at: one that is closed then was not pressed.
void gesture_start(bool closed);

// Takes the contact's level, to be called every GESTURE_SAMPLE_MS; says when a gesture is over.
enum gesture gesture_sample(bool closed);

#endif
