// The median of a few values, which are kept in order as they come.
#include "median.h"

#include "memory.h"

static __xdata uint32_t values[MEDIAN_MOST];
static __xdata uint8_t count;

void median_begin(void)
{
    count = 0;
}

void median_add(uint32_t value)
{
    uint8_t place = count++;
    for (; place != 0 && values[place - 1] > value; place--)
        values[place] = values[place - 1];
    values[place] = value;
}

uint32_t median_value(void)
{
    return values[count / 2];
}
