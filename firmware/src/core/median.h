// The median of a few values.
#ifndef MEDIAN_H
#define MEDIAN_H

#include <stdint.h>

#define MEDIAN_MOST 5 // values

void median_begin(void);

void median_add(uint32_t value);

// The median of an odd number of values.
uint32_t median_value(void);

#endif
