// The 28BYJ-48: half steps made by interrupt, each after the interval that was queued for it.
#ifndef STEPPER_H
#define STEPPER_H

#include <stdbool.h>
#include <stdint.h>

#include "irq.h"

#define STEPPER_PHASES 8 // of the coils: the rotor looks the same every so many half steps

void stepper_start(void);

// Sets the turning direction of the half steps queued from now on; only while stepper_is_turning() is false.
void stepper_set_direction(bool decreasing);

bool stepper_has_room(void);

#define STEPPER_LONGEST_TOGETHER_US 16383

// Queues half steps (one, where the interval is longer than that), each `interval_us` (at most 32,766) after the one
// before it; there must be room.
void stepper_push(uint16_t interval_us, uint8_t half_steps);

// True until the last half step queued has been made.
bool stepper_is_turning(void);

// Takes the current off the coils. The next half step goes on in the same phase, so that none is lost.
void stepper_release(void);

// The position in half steps. It is the caller's to set while the motor rests.
int16_t stepper_position(void);
void stepper_set_position(int16_t half_steps);

// The phase of the coils in which the motor rests, rising with the position.
uint8_t stepper_phase(void);

// Looks for the home switch, before every half step, from now on; it closes at home, or opens. It is seen when three
// half steps in a row have found it so.
void stepper_watch_home(bool opens);
bool stepper_saw_home(void);

// The position at the first of these three, to be asked as soon as stepper_saw_home() is true.
int16_t stepper_home_position(void);

void stepper_isr(void) __interrupt(IRQ_TIMER3);

#endif
