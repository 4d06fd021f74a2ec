// The play of the gears. On the way up the sensor is where the motor is, on the way down it is the play above: between
// the two it rests where it was.
#include "backlash.h"

#include "memory.h"

static __xdata uint8_t play;
static __xdata int16_t sensor;

void backlash_set(uint8_t half_steps)
{
    play = half_steps;
}

int16_t backlash_motor_after_fall(int16_t half_step)
{
    sensor = half_step;
    return half_step - play;
}

int16_t backlash_sensor(int16_t motor)
{
    if (sensor < motor)
        sensor = motor;
    else if (sensor > motor + play)
        sensor = motor + play;
    return sensor;
}

int16_t backlash_motor(int16_t motor, int16_t wanted)
{
    int16_t now = backlash_sensor(motor);
    if (wanted == now)
        return motor;
    return wanted > now ? wanted : wanted - play;
}
