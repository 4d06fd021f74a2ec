// Plan and calibration as they lie in frames and in flash (CONFIGURE and CALIBRATE in ../../README.md).
#ifndef WIRE_LAYOUT_H
#define WIRE_LAYOUT_H

#include <stdint.h>

#include "calibration.h"
#include "memory.h"
#include "plan.h"

#define LAYOUT_PLAN_BYTES 14
#define LAYOUT_CALIBRATION_BYTES 8

void layout_read_plan(__xdata struct plan *plan, const __xdata uint8_t *bytes);
void layout_write_plan(__xdata uint8_t *bytes, const __xdata struct plan *plan);

void layout_read_calibration(__xdata struct calibration *calibration, const __xdata uint8_t *bytes);
void layout_write_calibration(__xdata uint8_t *bytes, const __xdata struct calibration *calibration);

#endif
