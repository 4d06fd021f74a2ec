// The supply monitor (datasheet chapter "Reset Sources"): it holds the chip in reset while VDD is too low.
#ifndef SUPPLY_H
#define SUPPLY_H

#include <stdbool.h>

// Turns the monitor on and makes it a reset source. To be called before anything else: until then the chip may run on a
// supply that is still rising, on which it reads and writes flash wrong.
void supply_guard(void);

// Whether the monitor is on and VDD above its threshold: flash may be written.
bool supply_is_sound(void);

#endif
