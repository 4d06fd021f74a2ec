// What a unit measures of itself on demand: the edges of its home switch on the way up and down, and one ping.
#ifndef MEASURE_H
#define MEASURE_H

#include <stdbool.h>
#include <stdint.h>

#include "core/calibration.h"
#include "core/memory.h"
#include "core/plan.h"

#define MEASURE_EDGES 3 // kept of each way

struct measured {
    uint8_t kind; // enum measure_kind
    uint8_t outcome; // enum measure_outcome
    uint8_t number; // of outcomes told, modulo 256
    uint8_t edges[2]; // on the way up and down
    int16_t edge[2][MEASURE_EDGES]; // half steps of the motor
    int16_t top; // where it turned round
    int16_t supply; // as hal/voltage.h has it
    uint32_t lag; // of the ping, as echo.h has them
    uint32_t width;
};

extern __xdata struct measured measured;

// A measurement is ordered; what it finds out takes the place of what the one before has.
void measure_order(uint8_t kind);

// Whether one was ordered and is not over.
bool measure_is_due(void);

// Begins it; the motor must rest, just below home but for MEASURE_PING.
void measure_begin(const __xdata struct calibration *calibration, const __xdata struct plan *plan);

// Goes on with it; true once it is over, and the motor rests again.
bool measure_step(void);

// Whether it has ended away from home, so that nobody knows where the sensor looks.
bool measure_is_lost(void);

// If one is under way, it ends with `outcome`, without a result. The motor may still turn, and a ping goes on: it is
// measure_step()'s to say when that is over.
void measure_give_up(uint8_t outcome);

#endif
