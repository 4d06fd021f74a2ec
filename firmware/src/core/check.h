// The check of the bearings: every few sweeps the unit finds home again and sees by how much its motor has slipped.
#ifndef CHECK_H
#define CHECK_H

#include <stdbool.h>
#include <stdint.h>

#include "calibration.h"
#include "memory.h"

// A slip that nobody knows: before the first check, and against an end stop.
#define SLIP_UNKNOWN 0x7FFF

// Counts a sweep, one that has readings.
void check_count_sweep(void);

// Whether home is to be found before the next sweep; `half_step` is where the sensor looks.
bool check_is_due(const __xdata struct calibration *calibration, int16_t half_step);

// Home was found, with the sensor's bearings `slip` half steps too high before, or SLIP_UNKNOWN.
void check_end(int16_t slip);

// The latest slip, in half steps, and the number of homes found.
int16_t check_slip(void);
uint8_t check_number(void);

// Whether the latest check found a slip: until one finds none, the motor may slip again.
bool check_slipped(void);

// What the next sweep carries in its flags; what it says of earlier sweeps is said once, whatever the checks since found.
uint8_t check_sweep_flags(void);

#endif
