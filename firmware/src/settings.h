// The unit's settings page in flash, written when the unit is flashed.
#ifndef SETTINGS_H
#define SETTINGS_H

#include <stdint.h>

// The unit's serial number, or SERIAL_NONE if the page holds none.
uint32_t settings_serial(void);

#endif
