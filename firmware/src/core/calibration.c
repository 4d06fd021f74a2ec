// The calibration of a unit.
#include "calibration.h"

#define BELOW_FORWARD(degrees) ((int16_t)(-((degrees) * 65536L + 180) / 360)) // the nearest 1/65536 turn
#define HALF_STEPS(half_steps) ((half_steps) * 256UL)
#define MOST_BACKLASH 128

// The gears 32/9, 22/11, 26/9 and 31/10 make 25792/405 turns of the rotor, of 64 half steps each, for one of the shaft.
const __code struct calibration calibration_default = {
    .half_steps_per_turn = (HALF_STEPS(25792UL * 64) + 405 / 2) / 405,
    .backlash = 0,
    .home = HOME_SWITCH,
    .home_bearing = BELOW_FORWARD(150),
};

bool calibration_is_possible(const __xdata struct calibration *calibration)
{
    return calibration->half_steps_per_turn >= HALF_STEPS(3800) &&
           calibration->half_steps_per_turn <= HALF_STEPS(4400) &&
           calibration->backlash <= MOST_BACKLASH && calibration->home <= HOME_OPENING_SWITCH &&
           calibration->home_bearing <= BELOW_FORWARD(148);
}
