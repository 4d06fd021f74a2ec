// Bearings and half steps. A turn is not a whole number of half steps, so both ways go by its 1/256 half steps, and
// without a division of 32 bits or more, which the 8051 has none of.
#include "bearing.h"

#include "memory.h"

#define BEARING_BITS 16

static __xdata uint32_t turn; // 1/256 half steps, 21 bits at most

void bearing_set_turn(uint32_t half_steps_per_turn)
{
    turn = half_steps_per_turn;
}

// bearing * turn / 2^24, rounded: by the halves of `turn`, for the product has up to 36 bits.
int16_t bearing_to_half_step(int16_t bearing)
{
    uint16_t size = bearing < 0 ? -(uint16_t)bearing : bearing;
    uint32_t low = (uint32_t)size * (uint16_t)turn;
    uint32_t high = (uint32_t)size * (uint16_t)(turn >> 16);
    int16_t half_step = (int16_t)((high + (low >> 16) + 128) >> 8);
    return bearing < 0 ? -half_step : half_step;
}

// half_step / turn, digit by digit, as on paper, with binary digits.
int16_t bearing_of_half_step(int16_t half_step)
{
    uint32_t remainder = (uint32_t)(half_step < 0 ? -half_step : half_step) * 256;
    uint16_t bearing = 0;
    for (uint8_t digit = 0; digit < BEARING_BITS; digit++) {
        remainder *= 2;
        bearing *= 2;
        if (remainder >= turn) {
            remainder -= turn;
            bearing++;
        }
    }
    if (2 * remainder >= turn)
        bearing++;
    return (int16_t)(half_step < 0 ? -bearing : bearing);
}
