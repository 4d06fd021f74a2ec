// The host's requests: how long each is.
#ifndef REQUEST_H
#define REQUEST_H

#include <stdint.h>

#define REQUEST_UNKNOWN 0

// The bytes of a frame of this type, without its CRC, or REQUEST_UNKNOWN.
uint8_t request_length(uint8_t type);

#endif
