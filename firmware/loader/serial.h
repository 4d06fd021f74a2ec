// The unit's serial number, by the table in ../README.md, Flash.
#ifndef SERIAL_H
#define SERIAL_H

#include <stdint.h>

// SERIAL_NONE if no settings page is sound. Both pages hold the same.
uint32_t serial_number(void);

#endif
