// Homing: finds the home switch, and with it where the motor stands.
#ifndef HOMING_H
#define HOMING_H

#include <stdbool.h>

enum homing_outcome { HOMING_GOES_ON, HOMING_FOUND, HOMING_FAILED };

// Begins the search; the motor must rest.
void homing_begin(void);

// Goes on with the search, until it says that it is over; then the motor rests again.
enum homing_outcome homing_step(void);

#endif
