// The system clock: 48 MHz from the internal oscillator.
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

// Takes SYSCLK from the 1.5 MHz of reset to 48 MHz. To be called once, with interrupts off.
void clock_start(void);

// Does nothing for `microseconds` or a little longer, at 48 MHz.
void clock_wait_us(uint8_t microseconds);

#endif
