// What the application does for its own update: it gives way to the loader, and confirms itself to it. One that nobody
// greets within five minutes resets the chip: it may be deaf, and the loader counts its starts.
#ifndef UPDATE_H
#define UPDATE_H

#include <stdint.h>

// The command UPDATE, meant for the unit of this serial number; gives an enum result. The chip is reset once that is
// out.
uint8_t update_begin(uint32_t serial);

// This application works: the loader need not count its starts any more.
void update_confirm(void);

#define UPDATE_TASK_MS 10

// To be called every UPDATE_TASK_MS.
void update_task(void);

#endif
