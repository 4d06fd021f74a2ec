// Plan and calibration as bytes, field by field in the order of their frames.
#include "wire_layout.h"

#include "little_endian.h"

void layout_read_plan(__xdata struct plan *plan, const __xdata uint8_t *bytes)
{
    plan->first_bearing = get16(bytes);
    plan->bearing_step = get16(bytes + 2);
    plan->count = bytes[4];
    plan->ping_interval_ms = get16(bytes + 5);
    plan->top_speed = get16(bytes + 7);
    plan->ramp_ms = get16(bytes + 9);
    plan->settle_ms = get16(bytes + 11);
    plan->pings = bytes[13];
}

void layout_write_plan(__xdata uint8_t *bytes, const __xdata struct plan *plan)
{
    put16(bytes, plan->first_bearing);
    put16(bytes + 2, plan->bearing_step);
    bytes[4] = plan->count;
    put16(bytes + 5, plan->ping_interval_ms);
    put16(bytes + 7, plan->top_speed);
    put16(bytes + 9, plan->ramp_ms);
    put16(bytes + 11, plan->settle_ms);
    bytes[13] = plan->pings;
}

void layout_read_calibration(__xdata struct calibration *calibration, const __xdata uint8_t *bytes)
{
    calibration->half_steps_per_turn = get32(bytes);
    calibration->backlash = bytes[4];
    calibration->home = bytes[5];
    calibration->home_bearing = get16(bytes + 6);
}

void layout_write_calibration(__xdata uint8_t *bytes, const __xdata struct calibration *calibration)
{
    put16(bytes, (uint16_t)calibration->half_steps_per_turn);
    put16(bytes + 2, calibration->half_steps_per_turn >> 16);
    bytes[4] = calibration->backlash;
    bytes[5] = calibration->home;
    put16(bytes + 6, calibration->home_bearing);
}
