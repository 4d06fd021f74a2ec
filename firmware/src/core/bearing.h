// Bearings (1/65536 turn) and half steps of the 28BYJ-48, by its gears as they were calibrated.
#ifndef BEARING_H
#define BEARING_H

#include <stdint.h>

// Sets the half steps of a turn, in 1/256 half step.
void bearing_set_turn(uint32_t half_steps_per_turn);

// The half step nearest to a bearing. The position in half steps stays whole, so turning to and fro adds no error.
int16_t bearing_to_half_step(int16_t bearing);

// The bearing nearest to a half step less than a turn from forward.
int16_t bearing_of_half_step(int16_t half_step);

#endif
