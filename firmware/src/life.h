// The unit's life, which lasts as long as its boot numbers go up: those of a chip that was erased begin again, and its
// the life tells their sweeps from sweeps of the same boot and sequence that were made before.
#ifndef LIFE_H
#define LIFE_H

#include <stdint.h>

// Ends the life: boot numbers are about to begin again.
void life_end(void);

// Takes up the life, or begins one if there is none. To be called once, before the ring is taken up and before the
// watchdog runs.
void life_start(void);

// Never 0, which stands for no life.
uint32_t life_number(void);

#endif
