// Bearings and half steps. The gears 32/9, 22/11, 26/9 and 31/10 make 25792/405 turns of the rotor, of 64 half steps
// each, for one of the shaft: 4075.77 half steps. So 65536 units of bearing are 25792 * 64 / 405 half steps, or one
// unit 403/6480.
#include "bearing.h"

#define NUMERATOR 403L
#define DENOMINATOR 6480L

static int16_t rounded_quotient(int32_t dividend, int16_t divisor)
{
    int32_t half = divisor / 2;
    return (int16_t)((dividend + (dividend < 0 ? -half : half)) / divisor);
}

int16_t bearing_to_half_step(int16_t bearing)
{
    return rounded_quotient(bearing * NUMERATOR, DENOMINATOR);
}

int16_t bearing_of_half_step(int16_t half_step)
{
    return rounded_quotient(half_step * DENOMINATOR, NUMERATOR);
}
