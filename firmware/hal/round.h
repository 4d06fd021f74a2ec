// The rounds of the main loop: one every 2 ms, and the CPU sleeps in between.
#ifndef ROUND_H
#define ROUND_H

#include "irq.h"

#define ROUND_MS 2

// How many rounds last `ms` milliseconds, or just longer.
#define ROUNDS(ms) ((ms) / ROUND_MS + ((ms) % ROUND_MS != 0))

void round_start(void);

// Sleeps until the next round is due; if it is already, goes on at once. None is left out but while flash is erased: to
// count rounds is to count time.
void round_wait(void);

void round_isr(void) __interrupt(IRQ_TIMER2);

#endif
