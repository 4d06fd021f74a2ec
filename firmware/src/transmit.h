// Everything the unit sends: answers first, then news of its state, then sweeps; one frame at a time.
#ifndef TRANSMIT_H
#define TRANSMIT_H

#include <stdbool.h>
#include <stdint.h>

// Whether an answer may be given; one waits at most.
bool transmit_is_free(void);

// Give an answer.
void transmit_hello(uint8_t request, uint8_t protocol); // the host's
void transmit_status(uint8_t request);
void transmit_clock(uint8_t request, uint32_t received);
void transmit_settings(uint8_t request);
void transmit_mechanics(uint8_t request);
void transmit_result(uint8_t request, uint8_t command, uint8_t result);
void transmit_rejected(uint8_t reason, uint8_t type);

// Resets the chip, with this enum reset_note, when the answer given next has gone out; nothing goes out after it.
void transmit_then_reset(uint8_t note);

void transmit_task(void);

#endif
