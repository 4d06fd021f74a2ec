// Homing: finds the home switch or the end stop, and with it where the motor stands.
#ifndef HOMING_H
#define HOMING_H

#include "core/calibration.h"
#include "core/memory.h"

enum homing_outcome { HOMING_GOES_ON, HOMING_FOUND, HOMING_NO_SWITCH, HOMING_SWITCH_STAYS_CLOSED };

// Begins the search; the motor must rest, and the calibration stay as it is until it is over.
void homing_begin(const __xdata struct calibration *calibration);

// Goes on with the search, until it says that it is over; then the motor rests again.
enum homing_outcome homing_step(void);

#endif
