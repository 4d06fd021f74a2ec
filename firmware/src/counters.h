// What STATUS counts since boot; each count is kept by the module that sees the event.
#ifndef COUNTERS_H
#define COUNTERS_H

#include <stdint.h>

#include "core/memory.h"

struct counters {
    uint32_t sweeps_made;
    uint16_t sweeps_resent;
    uint16_t frames_bad;
    uint16_t frames_unknown;
    uint16_t echo_faults;
};

extern __xdata struct counters counters;

#endif
