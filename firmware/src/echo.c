// One ping of the HC-SR04. The line rises some 450 us after the trigger (42 ms, on some copies of the sensor) and stays
// high for the time of flight, or for the sensor's own time-out of some 38 ms; copies hold it for up to 200 ms, or
// until their power is cut.
#include "echo.h"

#include "../hal/pins.h"
#include "../hal/timebase.h"
#include "core/memory.h"
#include "core/protocol.h"
#include "core/turns.h"
#include "counters.h"

// A round sooner than expected; else the next one would ping, 2 ms late.
#define WORTH_WAITING_TICKS (250 * TICKS_PER_US)
#define TRIGGER_TICKS (25 * TICKS_PER_US) // 10 us for an HC-SR04, 20 for a JSN-SR04T
#define SHORTEST_TICKS (100 * TICKS_PER_US) // 17 mm
#define LONGEST_TICKS (36 * TICKS_PER_MS) // 6.2 m, past the sensor's reach
#define RISE_LIMIT_TICKS (80 * TICKS_PER_MS)
#define FALL_LIMIT_TICKS (250 * TICKS_PER_MS)
#define STUCK_BEFORE_CUT 2 // readings in a row
#define CUT_TICKS (100 * TICKS_PER_MS)
#define START_TICKS (50 * TICKS_PER_MS) // of the sensor, when it has power again

// Its limits are in ticks, not in rounds: a main loop that is late makes up for its rounds faster than time passes.
static enum { OVER, AWAITING_INTERVAL, AWAITING_TURN, AWAITING_RISE, AWAITING_FALL, WITHOUT_POWER } phase;
static __xdata uint32_t due; // when the interval was over, or the line last seen low since
static __xdata uint32_t triggered;
static __xdata uint32_t trigger_ended;
static __xdata uint32_t interval_ticks;
static __xdata uint32_t value;
static __xdata uint32_t lag;
static __xdata uint32_t width;
static __xdata uint8_t stuck; // readings in a row that found the line stuck high
static __xdata uint32_t cut; // when the sensor's power was

// A sensor that holds its line may let go without power, if the board can cut it.
static void cut_power(void)
{
    stuck = 0;
    pins_power_sensor(false);
    cut = timebase_now();
    phase = WITHOUT_POWER;
}

static void await_power(void)
{
    uint32_t since = timebase_now() - cut;
    if (since >= CUT_TICKS)
        pins_power_sensor(true);
    if (since >= CUT_TICKS + START_TICKS)
        phase = OVER;
}

static void finish(uint32_t result)
{
    value = result;
    phase = OVER;
    if (result != ECHO_STUCK_HIGH)
        stuck = 0;
    else if (++stuck == STUCK_BEFORE_CUT)
        cut_power();
    if (result > LONGEST_TICKS && result != ECHO_NONE)
        counters.echo_faults++;
}

static void trigger(void)
{
    timebase_watch_edges();
    triggered = timebase_now();
    pins_set_trigger(true);
    while (timebase_now() - triggered < TRIGGER_TICKS)
        ;
    pins_set_trigger(false);
    trigger_ended = timebase_now();
    phase = AWAITING_RISE;
}

// The line must be low too: a sensor that holds it would not take the trigger.
static void await_turn(void)
{
    if (!pins_echo_is_high()) {
        due = timebase_now();
        if (turns_may_ping(due))
            trigger();
    } else if (timebase_now() - due > FALL_LIMIT_TICKS) {
        triggered = timebase_now(); // the reading needs a time, and the next attempt its interval
        finish(ECHO_STUCK_HIGH);
    }
}

static void await_interval(void)
{
    due = timebase_now();
    if (due - triggered + WORTH_WAITING_TICKS < interval_ticks)
        return;
    while (due - triggered < interval_ticks)
        due = timebase_now();
    phase = AWAITING_TURN;
    await_turn();
}

static uint32_t measured(uint32_t rise, uint32_t fall)
{
    width = fall - rise;
    if (width < SHORTEST_TICKS)
        return ECHO_TOO_EARLY;
    return width > LONGEST_TICKS ? ECHO_NONE : width;
}

static void await_rise(void)
{
    if (timebase_edges() == 0) {
        if (timebase_now() - trigger_ended > RISE_LIMIT_TICKS)
            finish(ECHO_NO_SENSOR);
    } else if ((int32_t)(timebase_edge(0) - trigger_ended) < 0) {
        finish(ECHO_TOO_EARLY);
    } else {
        lag = timebase_edge(0) - trigger_ended;
        phase = AWAITING_FALL;
    }
}

static void await_fall(void)
{
    if (timebase_edges() == 2)
        finish(measured(timebase_edge(0), timebase_edge(1)));
    else if (timebase_now() - trigger_ended > FALL_LIMIT_TICKS)
        // Down again all the same: a pulse too short for its second edge to be captured apart.
        finish(pins_echo_is_high() ? ECHO_STUCK_HIGH : ECHO_TOO_EARLY);
}

void echo_ping(uint16_t interval_ms)
{
    interval_ticks = interval_ms * TICKS_PER_MS;
    lag = width = ECHO_NEVER;
    phase = AWAITING_INTERVAL;
}

bool echo_is_over(void)
{
    return phase == OVER;
}

uint32_t echo_triggered(void)
{
    return triggered;
}

uint32_t echo_value(void)
{
    return value;
}

uint32_t echo_lag(void)
{
    return lag;
}

uint32_t echo_width(void)
{
    return width;
}

void echo_task(void)
{
    if (phase == OVER)
        return;
    if (phase == AWAITING_INTERVAL)
        await_interval();
    else if (phase == AWAITING_TURN)
        await_turn();
    else if (phase == AWAITING_RISE)
        await_rise();
    else if (phase == AWAITING_FALL)
        await_fall();
    else
        await_power();
}
