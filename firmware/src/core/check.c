// When the bearings are checked, and what the sweeps say of it.
#include "check.h"

#include "memory.h"
#include "protocol.h"

#define EVERY 10 // sweeps; an even number ends near home
#define EVERY_AGAINST_STOP 30 // which is no good to either
#define AFTER_SLIP 2
#define TOLERATED 3 // half steps; a bouncing switch is found two early or late, a slip is eight or more
#define MOST_SUSPECT 63 // sweeps, what SWEEP's flags have room for

static __xdata uint8_t sweeps; // since the latest check
static __xdata uint8_t suspect; // made by bearings that a check found wrong, and no sweep has told of them yet
static __xdata uint8_t number;
static __xdata bool slipped;
static __xdata int16_t latest = SLIP_UNKNOWN;

void check_count_sweep(void)
{
    if (sweeps < MOST_SUSPECT)
        sweeps++;
}

bool check_is_due(const __xdata struct calibration *calibration, int16_t half_step)
{
    uint8_t every = EVERY;
    if (slipped)
        every = AFTER_SLIP;
    else if (calibration->home == HOME_STOP)
        every = EVERY_AGAINST_STOP;
    return half_step < 0 ? sweeps >= every : sweeps > every; // one more sweep, and home is nearer
}

void check_end(int16_t slip)
{
    slipped = slip != SLIP_UNKNOWN && (slip > TOLERATED || slip < -TOLERATED);
    if (slipped)
        suspect = suspect + sweeps < MOST_SUSPECT ? suspect + sweeps : MOST_SUSPECT;
    sweeps = 0;
    latest = slip;
    number++;
}

int16_t check_slip(void)
{
    return latest;
}

uint8_t check_number(void)
{
    return number;
}

bool check_slipped(void)
{
    return slipped;
}

uint8_t check_sweep_flags(void)
{
    uint8_t flags = (slipped || suspect != 0 ? SWEEP_SLIPPED : 0) | suspect << SWEEP_SUSPECT_SHIFT;
    suspect = 0;
    return flags;
}
