// The host's requests: how long each is.
#ifndef REQUEST_H
#define REQUEST_H

#include <stdbool.h>
#include <stdint.h>

#define REQUEST_UNKNOWN 0
#define REQUEST_FREE_START 4 // a START without turns, also from gateways that know of none

// The bytes of a frame of this type, without its CRC, or REQUEST_UNKNOWN.
uint8_t request_length(uint8_t type);

// Whether a frame of this type may have so many bytes.
bool request_has_length(uint8_t type, uint8_t length);

#endif
