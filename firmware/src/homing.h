// Homing: finds the home switch or the end stop, and with it where the motor stands.
#ifndef HOMING_H
#define HOMING_H

#include <stdbool.h>
#include <stdint.h>

#include "core/calibration.h"
#include "core/memory.h"

enum homing_outcome { HOMING_GOES_ON, HOMING_FOUND, HOMING_NO_SWITCH, HOMING_SWITCH_STAYS_CLOSED };

// Begins the search; the motor must rest, and the calibration stay as it is until it is over. A unit that is `homed`
// goes no farther than it must to an end stop.
void homing_begin(const __xdata struct calibration *calibration, bool homed);

// Goes on with the search, until it says that it is over; then the motor rests again.
enum homing_outcome homing_step(void);

// By how many half steps the bearings of a unit that was homed were too high, once home is found; SLIP_UNKNOWN where an
// end stop does not tell.
int16_t homing_slip(void);

// Says where the motor stands, which has found the switch at `found_at` on its way down, in its own half steps, and
// rests; after a homing.
void homing_take_switch(int16_t found_at);

#endif
