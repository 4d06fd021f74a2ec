// Time: PCA0 counts ticks of 0.25 us since boot, and captures the edges of the echo line.
#ifndef TIMEBASE_H
#define TIMEBASE_H

#include <stdbool.h>
#include <stdint.h>

#include "irq.h"

#define TICKS_PER_US 4
#define TICKS_PER_MS 4000UL

// Starts the count at 0. To be called once, before the watchdog.
void timebase_start(void);

// The count's low 32 bits, which wrap every 1,073 s: differences of shorter times are right.
uint32_t timebase_now(void);

// Waits, 8.2 ms at most, until 24 ms may pass with the CPU stopped and the count still be right.
void timebase_await_early(void);

// Bits 32 to 47 of the count at `tick`, a moment less than 537 s ago or ahead.
uint16_t timebase_high(uint32_t tick);

// Forgets the edges seen and waits for the next two of the echo line.
void timebase_watch_edges(void);

// Edges seen since: 0, 1 or 2; the line's further edges are not counted.
uint8_t timebase_edges(void);

// When edge 0 or 1 came, once timebase_edges() has counted it.
uint32_t timebase_edge(uint8_t edge);

void timebase_isr(void) __interrupt(IRQ_PCA0);

#endif
