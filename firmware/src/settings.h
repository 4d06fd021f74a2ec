// What a unit keeps over power-ups: its serial number, plan, calibration and the trim of its thermometer.
#ifndef SETTINGS_H
#define SETTINGS_H

#include <stdbool.h>
#include <stdint.h>

#include "core/memory.h"

#define SETTINGS_BYTES 24

// Hands out what flash holds; what it does not hold stays as it is. To be called once, when all that has settings is
// started.
void settings_start(void);

// The unit's serial number, or SERIAL_NONE if it was flashed without one.
uint32_t settings_serial(void);

// The settings in force, laid out as in a SETTINGS frame, until this is called again.
const __xdata uint8_t *settings_bytes(void);

// Whether flash holds those in force.
bool settings_are_stored(void);

// Stores those in force; false if flash did not take them. The motor must rest: it stops the CPU for up to 20 ms.
bool settings_store(void);

#endif
