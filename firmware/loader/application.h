// The application: whether it may be started, and starting it.
#ifndef APPLICATION_H
#define APPLICATION_H

#include <stdint.h>

// STAY_NONE if it may be started, else why not (enum stay).
uint8_t application_obstacle(void);

// Starts it, the chip being as after a reset but for its clock. One that is not confirmed uses up an attempt.
void application_start(void);

#endif
