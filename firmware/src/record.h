// Sweeps in the ring: written reading by reading as the SWEEP frame that will go out, dropped when acknowledged.
#ifndef RECORD_H
#define RECORD_H

#include <stdbool.h>
#include <stdint.h>

#include "core/memory.h"

// What names a sweep, boot, sequence, serial number and life: the first bytes after the type, of SWEEP as of ACK.
#define RECORD_NAME_BYTES 14

// Sets the boot number that new sweeps carry, and takes up those of earlier boots that memory has kept.
void record_start(uint16_t boot);

// Whether the ring has room for a sweep of so many readings.
bool record_has_room(uint8_t readings);

// Begins a sweep; `start` is the tick of its first trigger. There must be room.
void record_begin(uint32_t start, uint16_t waypoint, bool decreasing);

// Adds a reading; `triggered` is the tick of its trigger, `echo` as on the wire.
void record_reading(int16_t bearing, uint32_t triggered, uint32_t echo);

// A step towards handing the sweep over to the ring, to be called once in a round until it says that it is there.
bool record_finish(void);

// Whether the oldest sweep, once ring_seek() has found it, was made under the unit's serial number, or names none.
bool record_is_own(void);

// Drops the oldest sweep if `name`, so many bytes of an acknowledgement, is its whole name; false if it is not.
bool record_acknowledge(const __xdata uint8_t *name, uint8_t bytes);

#endif
