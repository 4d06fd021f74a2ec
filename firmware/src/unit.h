// The unit: what it is doing, and the commands that change it.
#ifndef UNIT_H
#define UNIT_H

#include <stdbool.h>
#include <stdint.h>

#include "core/calibration.h"
#include "core/memory.h"
#include "core/plan.h"

void unit_start_up(void);

// Commands; each returns an enum result.
uint8_t unit_configure(const __xdata struct plan *plan);
uint8_t unit_start(uint16_t pause_ms); // sweep after sweep until unit_stop()
uint8_t unit_stop(void);
uint8_t unit_single(void);
uint8_t unit_home(void);
uint8_t unit_set_waypoint(uint16_t waypoint);
uint8_t unit_go_to(int16_t bearing);
uint8_t unit_measure(uint8_t kind); // an enum measure_kind
uint8_t unit_calibrate(const __xdata struct calibration *calibration);

// What the unit goes by.
const __xdata struct plan *unit_plan(void);
const __xdata struct calibration *unit_calibration(void);

// Whether the motor rests and no sweep is under way, in states 0, 3, 4 and 5.
bool unit_is_at_rest(void);

// What STATUS says.
uint8_t unit_state(void); // enum state
uint8_t unit_flags(void);
uint8_t unit_fault(void); // enum fault
uint16_t unit_waypoint(void);

// Whether the state or the waypoint has changed since the last time this was asked.
bool unit_take_news(void);

void unit_task(void);

#endif
