// The supply's voltage, by the chip's reference.
#ifndef VOLTAGE_H
#define VOLTAGE_H

#include <stdint.h>

// By how much VDD exceeds the reference, in 1/512 of the reference's 2.44 V: some 180 at 3.3 V. Takes 10 us; the
// temperature sensor must have been started.
int16_t voltage_code(void);

#endif
