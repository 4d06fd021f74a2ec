// What an image says of itself: its description, by the table in ../README.md, Flash.
#include "image.h"

#include "../hal/flash.h"
#include "checksum.h"

#define CHECKED_BYTES (DESCRIPTION_ATTEMPTS - DESCRIPTION)

bool image_is_sound(uint16_t base)
{
    uint16_t length = image_length(base);
    return flash_read16(base + DESCRIPTION) == IMAGE_MAGIC && length <= DESCRIPTION &&
           checksum_of_flash(base + DESCRIPTION, CHECKED_BYTES) == CHECKSUM_OF_SOUND &&
           checksum_of_flash(base, length) == flash_read32(base + DESCRIPTION_IMAGE_CRC);
}

uint16_t image_length(uint16_t base)
{
    return flash_read16(base + DESCRIPTION_LENGTH);
}
