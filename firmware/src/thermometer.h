// The thermometer: the temperature of the chip, and that of the air once it is trimmed.
#ifndef THERMOMETER_H
#define THERMOMETER_H

#include <stdint.h>

void thermometer_start(void);

// The chip's temperature in 0.01 degrees C, with the trim if there is one; TEMPERATURE_NOT_MEASURED in the first
// seconds.
int16_t thermometer_chip(void);

// The air's, or TEMPERATURE_NOT_MEASURED too while there is no trim.
int16_t thermometer_air(void);

// The air has this temperature now: sets the trim. Returns an enum result.
uint8_t thermometer_learn(int16_t air);

// What is added to the sensor's own figure, in 0.01 K, or THERMOMETER_NO_TRIM.
#define THERMOMETER_NO_TRIM 0x7FFF
void thermometer_set_trim(int16_t trim);
int16_t thermometer_trim(void);

#define THERMOMETER_TASK_MS 10

// To be called every THERMOMETER_TASK_MS.
void thermometer_task(void);

#endif
