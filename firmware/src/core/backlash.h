// The play of the gears: the motor turns a little after each change of direction before the sensor follows.
#ifndef BACKLASH_H
#define BACKLASH_H

#include <stdint.h>

// Sets how many half steps the sensor stays behind after a change of direction.
void backlash_set(uint8_t half_steps);

// Says that the sensor looks at `half_step` after it has followed the motor downwards; returns where that is.
int16_t backlash_motor_after_fall(int16_t half_step);

// Where the sensor looks when the motor is at `motor`. To be asked at the end of every move at the latest.
int16_t backlash_sensor(int16_t motor);

// Where the motor must go for the sensor to look at half step `wanted`.
int16_t backlash_motor(int16_t motor, int16_t wanted);

#endif
