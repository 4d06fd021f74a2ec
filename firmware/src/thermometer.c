// The thermometer. A code of the sensor is 0.83 K wide: the mean of 64 that the sensor's own noise spreads resolves 0.1
// K.
#include "thermometer.h"

#include "../hal/temperature.h"
#include "core/memory.h"
#include "core/protocol.h"

#define CONVERSIONS 64 // their sum just fits 16 bits
#define TASKS_PER_CONVERSION (30 / THERMOMETER_TASK_MS)

// The sensor gives 776 mV and 2.86 mV/K, a code is 1/1024 of 2.44 V (datasheet, tables of the ADC and of the
// reference): 0.01 K are 2.44 / 65536 / 2.86e-5 = 21328 / 2^14 of the sum of 64 codes.
#define SLOPE 21328UL
#define SLOPE_LOG2 14
#define ZERO 27133 // 776 mV / 2.86 mV/K

#define COLDEST_AIR (-4000)
#define HOTTEST_AIR 8500
#define WIDEST_TRIM 3000 // sensor and reference are off by 14 K at the worst, and the chip is warmer than the air

static __xdata uint8_t until_conversion; // calls of the task
static __xdata uint8_t conversions;
static __xdata uint16_t sum;
static __xdata int16_t measured;
static __xdata int16_t trim;

static void begin_mean(void)
{
    conversions = 0;
    sum = CONVERSIONS / 2; // a code is rounded down
}

void thermometer_start(void)
{
    temperature_start();
    until_conversion = TASKS_PER_CONVERSION;
    measured = TEMPERATURE_NOT_MEASURED;
    trim = THERMOMETER_NO_TRIM;
    begin_mean();
}

void thermometer_task(void)
{
    if (--until_conversion != 0)
        return;
    until_conversion = TASKS_PER_CONVERSION;
    sum += temperature_code();
    if (++conversions != CONVERSIONS)
        return;
    measured = (int16_t)((sum * SLOPE >> SLOPE_LOG2) - ZERO);
    begin_mean();
}

int16_t thermometer_chip(void)
{
    if (measured == TEMPERATURE_NOT_MEASURED || trim == THERMOMETER_NO_TRIM)
        return measured;
    return measured + trim;
}

int16_t thermometer_air(void)
{
    return trim == THERMOMETER_NO_TRIM ? TEMPERATURE_NOT_MEASURED : thermometer_chip();
}

uint8_t thermometer_learn(int16_t air)
{
    int32_t wanted = (int32_t)air - measured;
    if (air < COLDEST_AIR || air > HOTTEST_AIR)
        return RESULT_OUT_OF_RANGE;
    if (measured == TEMPERATURE_NOT_MEASURED)
        return RESULT_BUSY;
    if (wanted < -WIDEST_TRIM || wanted > WIDEST_TRIM)
        return RESULT_OUT_OF_RANGE;
    trim = (int16_t)wanted;
    return RESULT_DONE;
}

void thermometer_set_trim(int16_t wanted)
{
    trim = wanted;
}

int16_t thermometer_trim(void)
{
    return trim;
}
