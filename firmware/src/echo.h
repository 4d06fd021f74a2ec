// One ping: triggers the HC-SR04 when it may be, and finds the time of flight or the reason why there is none.
#ifndef ECHO_H
#define ECHO_H

#include <stdbool.h>
#include <stdint.h>

// Asks for a ping, at the earliest `interval_ms` after the last one's trigger.
void echo_ping(uint16_t interval_ms);

// True when the ping asked for is over.
bool echo_is_over(void);

// The tick of the trigger, and the time of flight in ticks or one of the ECHO_ values, once the ping is over.
uint32_t echo_triggered(void);
uint32_t echo_value(void);

#define ECHO_NEVER 0xFFFFFFUL

// Of the latest ping, in ticks: from the trigger's end to the line's rise, and from there to its fall; ECHO_NEVER where
// that did not come.
uint32_t echo_lag(void);
uint32_t echo_width(void);

void echo_task(void);

#endif
