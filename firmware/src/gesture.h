// The button's gestures: a press, or two in a row.
#ifndef GESTURE_H
#define GESTURE_H

#include <stdbool.h>
#include <stdint.h>

enum gesture { GESTURE_NONE, GESTURE_PRESS, GESTURE_DOUBLE_PRESS };

#define GESTURE_SAMPLE_MS 10

// Takes the contact's level, to be called every GESTURE_SAMPLE_MS; says when a gesture is over.
enum gesture gesture_sample(bool closed);

#endif
