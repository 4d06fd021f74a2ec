// From home up until the switch has been seen as often as is wanted, or as far as is allowed, and the same way down
// again, which ends at home. The half steps at which the switch changed are all that is kept: what they mean is for the
// host to say.
#include "measure.h"

#include "../hal/stepper.h"
#include "../hal/voltage.h"
#include "core/protocol.h"
#include "core/ramp.h"
#include "echo.h"
#include "homing.h"
#include "motor.h"

#define SLOW_SPEED 250 // as slow as against an end stop, which a whole turn may meet; a round is no slower
#define RAMP_MS 100
#define PAST_EDGE 32 // half steps, past the switch's bounce
#define PLAY_REACH 512 // the most play, and to spare
#define TURN_REACH 4900 // a turn of 4400, the most, and to spare
#define TO_SPARE 96 // below where it began, 8 degrees, if half steps were lost on the way down
#define PING_INTERVAL_MS 60

enum way { UP, DOWN, PINGING };

__xdata struct measured measured;

static __xdata uint8_t way; // enum way
static __xdata uint8_t wanted; // edges
static __xdata bool at_home; // by the latest edge
static __xdata bool opens; // it is a normally-closed switch
static __xdata int16_t bottom; // where it began
static __xdata bool due;
static __xdata bool lost;

void measure_order(uint8_t kind)
{
    measured.kind = kind;
    measured.outcome = MEASURED_UNDER_WAY;
    measured.edges[UP] = measured.edges[DOWN] = 0;
    measured.lag = measured.width = ECHO_NEVER;
    measured.supply = voltage_code();
    due = true;
}

bool measure_is_due(void)
{
    return due;
}

bool measure_is_lost(void)
{
    return lost;
}

void measure_give_up(uint8_t outcome)
{
    if (!due)
        return;
    due = false;
    measured.number++;
    measured.outcome = outcome;
}

// The switch is at home where it closes, or opens.
static void watch(void)
{
    stepper_watch_home(at_home ? !opens : opens);
}

static void go(uint8_t new_way, int16_t half_steps)
{
    way = new_way;
    watch();
    motor_turn(half_steps);
}

void measure_begin(const __xdata struct calibration *calibration, const __xdata struct plan *plan)
{
    lost = false;
    if (measured.kind == MEASURE_PING) {
        way = PINGING;
        echo_ping(PING_INTERVAL_MS);
        return;
    }
    int16_t reach = PLAY_REACH;
    wanted = 1;
    ramp_set(SLOW_SPEED, RAMP_MS);
    if (measured.kind == MEASURE_TURN) {
        reach = TURN_REACH;
        wanted = MEASURE_EDGES;
    } else if (measured.kind == MEASURE_ROUND) {
        reach = (int16_t)(calibration->half_steps_per_turn >> 8) / 16 * 13; // 292 degrees, as far as a sweep
        wanted = 2; // the second would be a gear's that turns farther than it should
        ramp_set(plan->top_speed < SLOW_SPEED ? SLOW_SPEED : plan->top_speed, plan->ramp_ms);
    }
    opens = calibration->home == HOME_OPENING_SWITCH;
    at_home = true;
    bottom = stepper_position();
    go(UP, reach);
}

static void keep_edge(void)
{
    measured.edge[way][measured.edges[way]++] = stepper_home_position();
    at_home = !at_home;
    if (measured.edges[way] == wanted)
        motor_end_after(way == UP ? PAST_EDGE : 0);
    else
        watch();
}

static void turn_round(void)
{
    measured.top = stepper_position();
    wanted = measured.edges[UP] == 0 ? 1 : measured.edges[UP];
    go(DOWN, bottom - measured.top - TO_SPARE);
}

// The last edge on the way down is home's, whatever steps were lost before it.
static void find_home(void)
{
    if (measured.edges[DOWN] == wanted && at_home)
        homing_take_switch(measured.edge[DOWN][wanted - 1]);
    else
        lost = true;
}

static bool end(void)
{
    measure_give_up(MEASURED_DONE);
    return true;
}

bool measure_step(void)
{
    if (way == PINGING) {
        if (!echo_is_over())
            return false;
        measured.lag = echo_lag();
        measured.width = echo_width();
        return end();
    }
    if (measured.edges[way] < wanted && stepper_saw_home())
        keep_edge();
    if (motor_is_moving())
        return false;
    motor_half_step(); // the sensor has followed
    if (way == UP) {
        turn_round();
        return false;
    }
    find_home();
    return end();
}
