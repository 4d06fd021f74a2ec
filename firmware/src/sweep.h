// One sweep: turns from reading to reading, pings at each, and hands what it made over to the ring.
#ifndef SWEEP_H
#define SWEEP_H

#include <stdbool.h>
#include <stdint.h>

#include "core/memory.h"
#include "core/plan.h"

// Begins a sweep at whichever end of the plan is nearer; the motor must rest and the ring have room. The plan must stay
// as it is until the sweep is over.
void sweep_begin(const __xdata struct plan *plan, uint16_t waypoint);

// Ends the sweep after its present reading, or where its turn to the next one can be stopped.
void sweep_cut_short(void);

// Goes on with the sweep; true once it is over, and the motor rests again.
bool sweep_step(void);

#endif
