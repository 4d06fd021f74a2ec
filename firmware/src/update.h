// The command UPDATE: the application gives way to the loader.
#ifndef UPDATE_H
#define UPDATE_H

#include <stdint.h>

// For the unit of this serial number; gives an enum result. The chip is reset once that is out.
uint8_t update_begin(uint32_t serial);

#endif
