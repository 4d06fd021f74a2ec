// The present tick for code that no interrupt can break into: hal/*.c's service routines and critical sections.
#ifndef TIMEBASE_STAMP_H
#define TIMEBASE_STAMP_H

#include <stdint.h>

#include "chip.h"

extern volatile uint16_t timebase_wraps;

// Turns a reading of the 16-bit count into the 32-bit one. A wrap that is not served yet shows in CF, but belongs to
// the reading only if that is from after the wrap: then its high byte is still small.
#define TIMEBASE_EXTEND(low, high)                                                                                     \
    ((((uint32_t)(uint16_t)(timebase_wraps + (CF && (high) < 0x80))) << 16) | ((uint16_t)(high) << 8) | (low))

#endif
