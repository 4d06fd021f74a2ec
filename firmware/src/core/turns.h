// Turns to speak: units of one room each ping at `start` + k * `period` ticks, k any whole number, so that none hears
// another. Without turns a unit pings as soon as it is ready.
#ifndef TURNS_H
#define TURNS_H

#include <stdbool.h>
#include <stdint.h>

#define TURNS_OPEN_TICKS 12000 // 3 ms, a round and a late one: a turn that is missed by more is left out
#define TURNS_SHORTEST_TICKS 116000UL // 29 ms, the shortest ping interval
#define TURNS_LONGEST_TICKS 16000000UL // 4 s

// Has the unit ping by turns; `start` is less than 537 s from `now`. False if the period is out of range.
bool turns_set(uint32_t start, uint32_t period, uint32_t now);

// Has it ping as soon as it is ready.
void turns_clear(void);

bool turns_are_set(void);

// Whether the unit may ping now. turns_task() must have been called lately.
bool turns_may_ping(uint32_t now);

// Keeps the turn in mind that is next or has just come. To be called every TURNS_SHORTEST_TICKS at least.
void turns_task(uint32_t now);

#endif
