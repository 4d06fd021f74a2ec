// What the parts of pure_modules share.
#ifndef PURE_MODULES_H
#define PURE_MODULES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define MOST_BYTES 4096

extern uint8_t bytes[MOST_BYTES];

// Into bytes; gives how many.
size_t parse_hex(const char *hex);
// A frame whose memory ends at memory_end and goes on at memory.
void answer_encoded(const uint8_t *frame, size_t length, const uint8_t *memory, const uint8_t *memory_end);
// False if the command is none of the ring's.
bool answer_of_ring(const char *command, const char *arguments);

#endif
