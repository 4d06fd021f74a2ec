// Why the chip was reset, and the supply monitor that resets it.
#ifndef RESET_H
#define RESET_H

#include <stdbool.h>
#include <stdint.h>

// Notes the reset's cause and makes the VDD monitor a reset source, without which flash must not be written.
// To be called once, after clock_start().
void reset_start(void);

// RSTSRC as it was found.
uint8_t reset_cause(void);

// True when the supply had been away, so that nothing in memory can be trusted.
bool reset_was_power_up(void);

#endif
