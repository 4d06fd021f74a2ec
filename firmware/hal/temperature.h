// The chip's temperature sensor.
#ifndef TEMPERATURE_H
#define TEMPERATURE_H

#include <stdint.h>

// Turns the sensor on; it needs 2 ms before the first temperature_code().
void temperature_start(void);

// Converts its voltage: 0 to 1023, of the reference's. Takes 4 us.
uint16_t temperature_code(void);

#endif
