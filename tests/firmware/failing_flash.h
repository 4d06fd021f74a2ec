// A flash that may lose its power at any operation, and stand-ins for what else the firmware's code for flash calls.
#ifndef FAILING_FLASH_H
#define FAILING_FLASH_H

#include <setjmp.h>
#include <stdint.h>

#include "../../firmware/src/core/calibration.h"
#include "../../firmware/src/core/plan.h"

#define MEMORY_BYTES 64

enum outcome { NOT_DONE, DONE, HALF, OUTCOMES };

extern uint8_t flash[0x10000];
extern unsigned long operations; // since power-up
extern unsigned long cut_at; // the operation at which the power fails; 0: never
extern enum outcome outcome; // how that operation is left
extern jmp_buf power_fails; // where the program goes on then
extern uint32_t noise; // the state of draw(), not 0

// The next pseudo-random number.
uint32_t draw(void);

extern struct plan plan_in_force;
extern struct calibration calibration_in_force;
extern int16_t trim_in_force;
extern uint8_t memory[MEMORY_BYTES]; // the ring's, of which a life is drawn

#endif
