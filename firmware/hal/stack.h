// The stack: how much of it has ever been used, and whether it has met the end of memory.
#ifndef STACK_H
#define STACK_H

#include <stdbool.h>
#include <stdint.h>

// Paints what is free of it. To be called first of all.
void stack_start(void);

// False once the stack has overwritten the canary at its far end: whatever it holds may be wrong then.
bool stack_is_sound(void);

// Bytes that it has never used.
uint8_t stack_free(void);

#endif
