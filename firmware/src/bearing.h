// Bearings (1/65536 turn) and half steps of the 28BYJ-48, by its gear train's exact ratio.
#ifndef BEARING_H
#define BEARING_H

#include <stdint.h>

#define HALF_STEPS_PER_TURN 4076 // rounded up

// The half step nearest to a bearing. The position in half steps stays whole, so turning to and fro adds no error.
int16_t bearing_to_half_step(int16_t bearing);

// The bearing of a half step, of those within half a turn.
int16_t bearing_of_half_step(int16_t half_step);

#endif
