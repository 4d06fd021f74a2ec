// What an image says of itself, and whether that holds.
#ifndef IMAGE_H
#define IMAGE_H

#include <stdbool.h>
#include <stdint.h>

#include "../src/flash_layout.h"

// Whether description and content of the image at `base` (APPLICATION or STAGING) match their CRCs.
bool image_is_sound(uint16_t base);

// Bytes of content; the image must be sound.
uint16_t image_length(uint16_t base);

#endif
