// Linear ramps. At constant acceleration a = v / T the speed after n half steps is sqrt(2 a n), so the interval is
// sqrt(T / (2 v n)): no state but n, and the same on the way up and down. A table of 1 / sqrt(n) makes it a
// multiplication, for the 8051 is slow to divide. Past the table's end, at 128, every fourth n must do: it is
// within 0.8 % of the interval there.
#include "ramp.h"

#include "memory.h"

#define HALF_MICROSECONDS_SQUARED 125000000UL // (1e6 us/s)^2 * (1e-3 s/ms) / 2, over the 4 of half microseconds squared
#define SLOWEST_HALF_SQUARED (RAMP_SLOWEST_US / 2UL * (RAMP_SLOWEST_US / 2))
#define TABLE_END 128

// 65536 / sqrt(n) for n from 1 on; the first is one less, to fit.
static const __code uint16_t inverse_roots[TABLE_END] = {
    65535, 46341, 37837, 32768, 29309, 26755, 24770, 23170, 21845, 20724, 19760, 18919, 18176, 17515, 16921, 16384,
    15895, 15447, 15035, 14654, 14301, 13972, 13665, 13377, 13107, 12853, 12612, 12385, 12170, 11965, 11771, 11585,
    11408, 11239, 11078, 10923, 10774, 10631, 10494, 10362, 10235, 10112, 9994, 9880, 9770, 9663, 9559, 9459,
    9362, 9268, 9177, 9088, 9002, 8918, 8837, 8758, 8680, 8605, 8532, 8461, 8391, 8323, 8257, 8192,
    8129, 8067, 8006, 7947, 7890, 7833, 7778, 7723, 7670, 7618, 7567, 7517, 7469, 7420, 7373, 7327,
    7282, 7237, 7194, 7151, 7108, 7067, 7026, 6986, 6947, 6908, 6870, 6833, 6796, 6760, 6724, 6689,
    6654, 6620, 6587, 6554, 6521, 6489, 6457, 6426, 6396, 6365, 6336, 6306, 6277, 6249, 6220, 6193,
    6165, 6138, 6111, 6085, 6059, 6033, 6008, 5983, 5958, 5933, 5909, 5885, 5862, 5838, 5815, 5793,
};

static uint16_t cruise_us;
static uint8_t half_first_low; // of half the interval at n = 1, in us
static uint8_t half_first_high;
static __xdata uint8_t slow_levels; // from rest, whose intervals would be longer than the slowest

// Digit by digit, as on paper, with binary digits.
static uint16_t square_root(uint32_t square)
{
    uint32_t root = 0;
    for (uint32_t digit = 1UL << 30; digit != 0; digit >>= 2) {
        uint32_t trial = root + digit;
        root >>= 1;
        if (square >= trial) {
            square -= trial;
            root += digit;
        }
    }
    return (uint16_t)root;
}

// Half the first interval times inverse_root / 65536, from the products of the bytes, for the 8051 has no others.
static uint16_t half_interval_us(uint16_t inverse_root)
{
    uint8_t low = (uint8_t)inverse_root;
    uint8_t high = inverse_root >> 8;
    uint16_t middle = half_first_high * low + (uint8_t)(half_first_low * low >> 8);
    uint16_t other_middle = half_first_low * high + (uint8_t)middle;
    return half_first_high * high + (uint8_t)(middle >> 8) + (uint8_t)(other_middle >> 8);
}

void ramp_set(uint16_t top_speed, uint16_t ramp_ms)
{
    uint32_t half_squared = HALF_MICROSECONDS_SQUARED / top_speed * ramp_ms; // T / (2 v), 2.5e9 at most
    cruise_us = (uint16_t)(1000000UL / top_speed);
    uint16_t half_first_us = square_root(half_squared);
    half_first_low = (uint8_t)half_first_us;
    half_first_high = half_first_us >> 8;
    slow_levels = (uint8_t)(half_squared / SLOWEST_HALF_SQUARED); // 25 at most
}

uint16_t ramp_interval_us(uint16_t level)
{
    if (level <= slow_levels)
        return RAMP_SLOWEST_US;
    uint16_t root = level <= TABLE_END ? inverse_roots[level - 1] : inverse_roots[(level + 2) / 4 - 1] / 2;
    uint16_t interval_us = half_interval_us(root) * 2;
    return interval_us > cruise_us ? interval_us : cruise_us;
}

uint16_t ramp_cruise_us(void)
{
    return cruise_us;
}
