// One ping of the HC-SR04. The line rises some 450 us after the trigger and stays high for the time of flight, or for
// the sensor's own time-out of some 38 ms; copies of the sensor hold it for up to 200 ms.
#include "echo.h"

#include "../hal/pins.h"
#include "../hal/round.h"
#include "../hal/timebase.h"
#include "counters.h"
#include "memory.h"
#include "protocol.h"

#define WORTH_WAITING_TICKS (250 * TICKS_PER_US) // a round sooner than expected; else the next one would ping, 2 ms late
#define TRIGGER_TICKS (12 * TICKS_PER_US)
#define SHORTEST_TICKS (100 * TICKS_PER_US) // 17 mm
#define LONGEST_TICKS (36 * TICKS_PER_MS) // 6.2 m, past the sensor's reach
#define RISE_LIMIT_ROUNDS ROUNDS(10)
#define FALL_LIMIT_ROUNDS ROUNDS(250)

static enum { OVER, AWAITING_SENSOR, AWAITING_RISE, AWAITING_FALL } phase;
static uint8_t rounds; // since the trigger, or that a ping has been due and the line is not down
static __xdata uint32_t triggered;
static __xdata uint32_t trigger_ended;
static __xdata uint32_t interval_ticks;
static __xdata uint32_t value;

static void finish(uint32_t result)
{
    value = result;
    phase = OVER;
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
    rounds = 0;
    phase = AWAITING_RISE;
}

static void await_sensor(void)
{
    uint32_t now = timebase_now();
    if (now - triggered + WORTH_WAITING_TICKS < interval_ticks)
        return;
    while (now - triggered < interval_ticks)
        now = timebase_now();
    if (!pins_echo_is_high()) {
        trigger();
    } else if (++rounds > FALL_LIMIT_ROUNDS) {
        triggered = now; // the reading needs a time, and the next attempt its interval
        finish(ECHO_STUCK_HIGH);
    }
}

static uint32_t measured(uint32_t rise, uint32_t fall)
{
    uint32_t width = fall - rise;
    if (width < SHORTEST_TICKS)
        return ECHO_TOO_EARLY;
    return width > LONGEST_TICKS ? ECHO_NONE : width;
}

static void await_rise(void)
{
    rounds++;
    if (timebase_edges() == 0) {
        if (rounds > RISE_LIMIT_ROUNDS)
            finish(ECHO_NO_SENSOR);
    } else if ((int32_t)(timebase_edge(0) - trigger_ended) < 0) {
        finish(ECHO_TOO_EARLY);
    } else {
        phase = AWAITING_FALL;
    }
}

static void await_fall(void)
{
    rounds++;
    if (timebase_edges() == 2)
        finish(measured(timebase_edge(0), timebase_edge(1)));
    else if (rounds > FALL_LIMIT_ROUNDS)
        // Down again all the same: a pulse too short for its second edge to be captured apart.
        finish(pins_echo_is_high() ? ECHO_STUCK_HIGH : ECHO_TOO_EARLY);
}

void echo_ping(uint16_t interval_ms)
{
    interval_ticks = interval_ms * TICKS_PER_MS;
    rounds = 0;
    phase = AWAITING_SENSOR;
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

void echo_task(void)
{
    if (phase == OVER)
        return;
    if (phase == AWAITING_SENSOR)
        await_sensor();
    else if (phase == AWAITING_RISE)
        await_rise();
    else
        await_fall();
}
