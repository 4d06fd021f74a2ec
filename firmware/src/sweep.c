// One sweep. Sweeps alternate in direction by themselves: each begins where the last one has ended.
#include "sweep.h"

#include "../hal/timebase.h"
#include "core/bearing.h"
#include "core/median.h"
#include "core/ramp.h"
#include "echo.h"
#include "motor.h"
#include "record.h"

static enum { TURNING, SETTLING, PINGING, FINISHING } phase;
static const __xdata struct plan *__xdata plan;
static __xdata uint16_t waypoint;
static __xdata uint32_t rested; // the tick at which the motor was found at rest
static __xdata uint32_t settle_ticks; // of the plan; a multiplication is slow, so it is done once a sweep
static __xdata bool decreasing;
static __xdata bool cut_short;
static __xdata uint8_t readings; // made by now
static __xdata uint8_t pings; // of the present reading, made by now
static __xdata uint32_t triggered; // its middle ping

static void turn_to_reading(void)
{
    uint8_t reading = decreasing ? plan->count - 1 - readings : readings;
    motor_go(bearing_to_half_step(plan_bearing(plan, reading)));
    phase = TURNING;
}

static void begin_reading(void)
{
    median_begin();
    pings = 0;
    echo_ping(plan->ping_interval_ms);
    phase = PINGING;
}

static void keep_ping(void)
{
    if (readings == 0 && pings == 0)
        record_begin(echo_triggered(), waypoint, decreasing);
    if (pings == plan->pings / 2)
        triggered = echo_triggered();
    median_add(echo_value()); // that there is none counts as farther than any
    pings++;
}

static void keep_reading(void)
{
    record_reading(bearing_of_half_step(motor_half_step()), triggered, median_value());
    readings++;
}

// A step towards the end: whether it is reached.
static bool finish(void)
{
    phase = FINISHING;
    return readings == 0 || record_finish();
}

void sweep_begin(const __xdata struct plan *wanted, uint16_t number)
{
    int16_t first = bearing_to_half_step(plan_bearing(wanted, 0));
    int16_t last = bearing_to_half_step(plan_bearing(wanted, wanted->count - 1));
    plan = wanted;
    waypoint = number;
    settle_ticks = wanted->settle_ms * TICKS_PER_MS;
    ramp_set(wanted->top_speed, wanted->ramp_ms);
    decreasing = 2 * motor_half_step() > first + last;
    cut_short = false;
    readings = 0;
    turn_to_reading();
}

void sweep_cut_short(void)
{
    cut_short = true;
    if (phase == TURNING)
        motor_end_after(0);
}

bool sweep_step(void)
{
    switch (phase) {
    case TURNING:
        if (motor_is_moving())
            return false;
        rested = timebase_now();
        phase = SETTLING;
        return cut_short && finish();
    case SETTLING:
        if (timebase_now() - rested >= settle_ticks)
            begin_reading();
        return false;
    case FINISHING:
        return finish();
    default: // PINGING
        if (!echo_is_over())
            return false;
        keep_ping();
        if (pings != plan->pings) {
            echo_ping(plan->ping_interval_ms);
            return false;
        }
        keep_reading();
        if (cut_short || readings == plan->count)
            return finish();
        turn_to_reading();
        return false;
    }
}
