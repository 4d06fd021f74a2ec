// How long each half step of a move takes: constant acceleration from rest, top speed, constant deceleration to rest.
#ifndef RAMP_H
#define RAMP_H

#include <stdint.h>

#define RAMP_SLOWEST_US 20000 // 50 half steps/s, which the motor follows from rest

// Sets the top speed (50 to 1000 half steps/s; CONFIGURE gives 800 at most) and the time to reach it from rest (0 to 1000 ms).
void ramp_set(uint16_t top_speed, uint16_t ramp_ms);

// The interval before the half step that is the `level`th from rest, whether the move speeds up or slows down. `level`
// is 1 to 512; the longest ramp has 501.
uint16_t ramp_interval_us(uint16_t level);

// The interval at top speed.
uint16_t ramp_cruise_us(void);

#endif
