// Moves: from where the motor rests to a half step, with ramps.
#ifndef MOTOR_H
#define MOTOR_H

#include <stdbool.h>
#include <stdint.h>

// Starts a move to `half_step`; the motor must rest.
void motor_go(int16_t half_step);

// Ends the move under way `half_steps` further on, or as soon after as the ramp down allows.
void motor_end_after(uint16_t half_steps);

bool motor_is_moving(void);

// Plans the half steps to come; to be called at least every few milliseconds.
void motor_task(void);

#endif
