// The host's commands: runs each once, and answers it as often as it comes.
#ifndef COMMAND_H
#define COMMAND_H

#include <stdint.h>

#include "core/memory.h"

// Answers a frame whose CRC holds: `type` and payload, `length` bytes in all, which came in at `received`. The caller
// makes sure that an answer may be given (transmit_is_free), and rejects the frame for the enum reason returned.
uint8_t command_take(const __xdata uint8_t *frame, uint8_t length, uint32_t crc, uint32_t received);

#endif
