// Everything the unit sends: answers first, then news of its state, then sweeps; one frame at a time.
#ifndef TRANSMIT_H
#define TRANSMIT_H

#include <stdbool.h>
#include <stdint.h>

// Whether an answer may be given; one waits at most.
bool transmit_is_free(void);

// Give an answer.
void transmit_hello(uint8_t request);
void transmit_status(uint8_t request);
void transmit_clock(uint8_t request, uint32_t received);
void transmit_result(uint8_t request, uint8_t command, uint8_t result);
void transmit_rejected(uint8_t reason, uint8_t type);

void transmit_task(void);

#endif
