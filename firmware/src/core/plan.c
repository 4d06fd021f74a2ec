// The plan of a sweep.
#include "plan.h"

#define DEGREES(degrees) ((int16_t)((degrees) * 65536L / 360))
#define OUTERMOST DEGREES(148) // short of the home at -148 degrees or below
// A 28BYJ-48 follows some 1,000 half steps/s at best, without load and on a full 5 V.
#define FASTEST 800
// Faster, it does not start without a ramp.
#define FASTEST_FROM_REST 500
#define SHORTEST_RAMP_MS 50

const __code struct plan plan_default = {
    .first_bearing = DEGREES(-135),
    .bearing_step = DEGREES(45) / 2,
    .count = 13,
    .ping_interval_ms = 60,
    .top_speed = 600,
    .ramp_ms = 100,
    .settle_ms = 20,
    .pings = 1,
};

static bool ramp_is_too_short(const __xdata struct plan *plan)
{
    return plan->top_speed > FASTEST_FROM_REST && plan->ramp_ms < SHORTEST_RAMP_MS;
}

void plan_ease(__xdata struct plan *plan)
{
    if (plan->top_speed > FASTEST)
        plan->top_speed = FASTEST;
    if (ramp_is_too_short(plan))
        plan->ramp_ms = SHORTEST_RAMP_MS;
}

bool plan_is_possible(const __xdata struct plan *plan)
{
    if (plan->count < 1 || plan->count > 64)
        return false;
    int32_t last_bearing = plan->first_bearing + (int32_t)plan->bearing_step * (plan->count - 1);
    return plan->first_bearing >= -OUTERMOST && last_bearing <= OUTERMOST && plan->ping_interval_ms >= 29 &&
           plan->ping_interval_ms <= 1000 && plan->top_speed >= 50 && plan->top_speed <= FASTEST &&
           plan->ramp_ms <= 1000 && !ramp_is_too_short(plan) && plan->settle_ms <= 1000 &&
           (plan->pings == 1 || plan->pings == 3 || plan->pings == 5);
}

bool plan_can_look_at(int16_t bearing)
{
    return bearing >= -OUTERMOST && bearing <= OUTERMOST;
}

int16_t plan_bearing(const __xdata struct plan *plan, uint8_t reading)
{
    return (int16_t)(plan->first_bearing + plan->bearing_step * reading);
}
