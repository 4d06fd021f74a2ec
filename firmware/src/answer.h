// The frames of the unit's answers: composes one and hands it to the COBS encoder, which must be free.
#ifndef ANSWER_H
#define ANSWER_H

#include <stdint.h>

// Notes what HELLO says of this boot.
void answer_start(uint16_t boot);

void answer_hello(uint8_t request, uint8_t protocol); // the host's
void answer_status(uint8_t request);
void answer_clock(uint8_t request, uint32_t received, uint32_t sent);
void answer_settings(uint8_t request);
void answer_mechanics(uint8_t request);
void answer_result(uint8_t request, uint8_t command, uint8_t result);
void answer_rejected(uint8_t reason, uint8_t type);

#endif
