// The unit: homes and sweeps for as long as is asked and the ring has room.
#include "unit.h"

#include <stdbool.h>

#include "../hal/round.h"
#include "../hal/stepper.h"
#include "core/backlash.h"
#include "core/bearing.h"
#include "core/check.h"
#include "core/protocol.h"
#include "core/ramp.h"
#include "core/turns.h"
#include "homing.h"
#include "measure.h"
#include "motor.h"
#include "record.h"
#include "sweep.h"

static enum activity { RESTING, HOMING, ABANDONING, SWEEPING, AWAITING_ROOM, PAUSING, TURNING, MEASURING } activity;
static __bit has_news; // the state or the waypoint has changed
static __xdata struct plan plan;
static __xdata struct calibration calibration;
static __xdata uint16_t pause_rounds;
static __xdata uint16_t paused; // rounds since the pause began
static __xdata uint16_t waypoint;
static __xdata uint8_t fault;
static __xdata bool homed;
static __xdata bool started; // goes on until STOP
static __xdata bool single; // one sweep is asked for

bool unit_is_at_rest(void)
{
    return activity == RESTING || activity == AWAITING_ROOM || activity == PAUSING;
}

static void become(enum activity next)
{
    if (next != activity)
        has_news = true;
    activity = next;
}

static void begin_homing(void)
{
    fault = FAULT_NONE;
    homing_begin(&calibration, homed);
    become(HOMING);
}

// What comes next when the motor rests and no sweep is under way.
static void go_on(void)
{
    if (measure_is_due()) {
        measure_begin(&calibration, &plan);
        become(MEASURING);
    } else if (!started && !single) {
        turns_clear(); // nobody gives them again to a unit at rest
        stepper_release();
        become(RESTING);
    } else if (!homed || check_is_due(&calibration, motor_half_step())) {
        begin_homing();
    } else if (record_has_room(plan.count)) {
        sweep_begin(&plan, waypoint);
        become(SWEEPING);
    } else {
        stepper_release();
        become(AWAITING_ROOM);
    }
}

static void end_homing(enum homing_outcome outcome)
{
    if (outcome == HOMING_FOUND)
        check_end(homed ? homing_slip() : SLIP_UNKNOWN);
    homed = outcome == HOMING_FOUND;
    if (!homed) {
        fault = outcome == HOMING_NO_SWITCH ? FAULT_NO_HOME_SWITCH : FAULT_HOME_STAYS_CLOSED;
        started = false;
        single = false;
        measure_give_up(outcome == HOMING_NO_SWITCH ? MEASURED_NO_SWITCH : MEASURED_STAYS_CLOSED);
    }
    go_on();
}

static void end_sweep(void)
{
    single = false;
    if (!started || pause_rounds == 0) {
        go_on();
        return;
    }
    stepper_release();
    paused = 0;
    become(PAUSING);
}

void unit_task(void)
{
    enum homing_outcome outcome;
    if (activity == RESTING)
        return;
    if (activity == SWEEPING) { // before the switch, which costs more
        if (sweep_step())
            end_sweep();
        return;
    }
    switch (activity) {
    case HOMING:
        outcome = homing_step();
        if (outcome != HOMING_GOES_ON)
            end_homing(outcome);
        break;
    case ABANDONING:
    case TURNING:
        if (!motor_is_moving())
            go_on();
        break;
    case MEASURING:
        if (measure_step()) {
            homed = homed && !measure_is_lost();
            go_on();
        }
        break;
    case AWAITING_ROOM:
        go_on();
        break;
    case PAUSING:
        if (++paused >= pause_rounds)
            go_on();
        break;
    }
}

static void follow_calibration(void)
{
    bearing_set_turn(calibration.half_steps_per_turn);
    backlash_set(calibration.backlash);
    homed = false;
}

void unit_start_up(void)
{
    plan = plan_default;
    calibration = calibration_default;
    follow_calibration();
    waypoint = WAYPOINT_NONE;
}

uint8_t unit_configure(const __xdata struct plan *wanted)
{
    if (!plan_is_possible(wanted))
        return RESULT_OUT_OF_RANGE;
    if (!unit_is_at_rest())
        return RESULT_BUSY;
    plan = *wanted;
    return RESULT_DONE;
}

uint8_t unit_calibrate(const __xdata struct calibration *wanted)
{
    if (!calibration_is_possible(wanted))
        return RESULT_OUT_OF_RANGE;
    if (!unit_is_at_rest())
        return RESULT_BUSY;
    calibration = *wanted;
    follow_calibration();
    return RESULT_DONE;
}

uint8_t unit_start(uint16_t pause_ms)
{
    started = true;
    pause_rounds = ROUNDS(pause_ms);
    if (activity == RESTING)
        go_on();
    return RESULT_DONE;
}

uint8_t unit_stop(void)
{
    started = false;
    single = false;
    measure_give_up(MEASURED_STOPPED);
    if (activity == SWEEPING) {
        sweep_cut_short();
    } else if (activity == TURNING) {
        motor_end_after(0);
    } else if (activity == MEASURING && measured.kind != MEASURE_PING) { // a ping goes on to its end
        homed = false; // it may have turned too far
        motor_end_after(0);
        activity = ABANDONING;
    } else if (activity == HOMING) {
        motor_end_after(0);
        homed = homed && calibration.home != HOME_STOP; // the motor may have fallen back
        activity = ABANDONING; // no news: for the host that is homing too
    } else if (unit_is_at_rest()) {
        go_on();
    }
    return RESULT_DONE;
}

uint8_t unit_single(void)
{
    if (activity != RESTING)
        return RESULT_BUSY;
    single = true;
    go_on();
    return RESULT_DONE;
}

uint8_t unit_home(void)
{
    if (!unit_is_at_rest())
        return RESULT_BUSY;
    begin_homing();
    return RESULT_DONE;
}

uint8_t unit_go_to(int16_t bearing)
{
    if (!plan_can_look_at(bearing))
        return RESULT_OUT_OF_RANGE;
    if (activity != RESTING)
        return RESULT_BUSY;
    if (!homed)
        return RESULT_NOT_HOMED;
    ramp_set(plan.top_speed, plan.ramp_ms);
    motor_go(bearing_to_half_step(bearing));
    become(TURNING);
    return RESULT_DONE;
}

uint8_t unit_measure(uint8_t kind)
{
    if (kind > MEASURE_PING || (kind != MEASURE_PING && calibration.home == HOME_STOP))
        return RESULT_OUT_OF_RANGE;
    if (activity != RESTING)
        return RESULT_BUSY;
    measure_order(kind);
    if (kind == MEASURE_PING)
        go_on();
    else
        begin_homing();
    return RESULT_DONE;
}

uint8_t unit_set_waypoint(uint16_t number)
{
    if (number != waypoint)
        has_news = true;
    waypoint = number;
    return RESULT_DONE;
}

uint8_t unit_state(void)
{
    switch (activity) {
    case RESTING:
        return fault == FAULT_NONE ? STATE_IDLE : STATE_FAULT;
    case HOMING:
    case ABANDONING:
        return STATE_HOMING;
    case SWEEPING:
        return STATE_SWEEPING;
    case AWAITING_ROOM:
        return STATE_WAITING;
    case TURNING:
        return STATE_TURNING;
    case MEASURING:
        return STATE_MEASURING;
    default:
        return STATE_PAUSING;
    }
}

bool unit_take_news(void)
{
    bool news = has_news;
    has_news = false;
    return news;
}

uint8_t unit_flags(void)
{
    return (homed ? STATUS_HOMED : 0) | (started ? STATUS_STARTED : 0) | (check_slipped() ? STATUS_SLIPPED : 0) |
           (turns_are_set() ? STATUS_IN_TURN : 0) |
           (uint8_t)((check_number() + measured.number) << STATUS_NUMBER_SHIFT);
}

uint8_t unit_fault(void)
{
    return fault;
}

uint16_t unit_waypoint(void)
{
    return waypoint;
}

const __xdata struct plan *unit_plan(void)
{
    return &plan;
}

const __xdata struct calibration *unit_calibration(void)
{
    return &calibration;
}
