// Moves: from where the motor rests to a half step, with ramps. The half steps are those of the sensor on its shaft,
// which are the motor's but for the play of the gears.
#ifndef MOTOR_H
#define MOTOR_H

#include <stdbool.h>
#include <stdint.h>

// Starts a move that ends with the sensor at `half_step`; the motor must rest.
void motor_go(int16_t half_step);

// Starts a move of the motor by so many half steps, with no regard to the play; it must rest.
void motor_turn(int16_t half_steps);

// Ends the move under way `half_steps` further on, or as soon after as the ramp down allows.
void motor_end_after(uint16_t half_steps);

bool motor_is_moving(void);

// The half step at which the sensor looks.
int16_t motor_half_step(void);

// Says which one that is, after a move downwards.
void motor_set_half_step(int16_t half_step);

// Plans the half steps to come; to be called at least every few milliseconds.
void motor_task(void);

#endif
