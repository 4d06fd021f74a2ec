// Delivery of sweeps: the oldest in the ring is sent, and sent again, until it is acknowledged.
#ifndef DELIVERY_H
#define DELIVERY_H

#include <stdbool.h>
#include <stdint.h>

#include "core/memory.h"

// Counts the rounds until the oldest sweep should go out.
void delivery_task(void);

// Whether it should go out now.
bool delivery_is_due(void);

// Hands the oldest sweep to the COBS encoder, which must be free. It stays where it is until delivery_end().
void delivery_begin(void);
void delivery_end(void);

// Takes an acknowledgement: drops the sweep that it names by so many bytes, RECORD_NAME_BYTES at most, if that is the
// oldest.
void delivery_acknowledge(const __xdata uint8_t *name, uint8_t bytes);

// A sound frame of the host has come in.
void delivery_host_is_heard(void);

// A host has come: it need not wait until the oldest sweep would be sent again.
void delivery_hasten(void);

#endif
