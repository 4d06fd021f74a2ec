// The unit's serial number, in whichever settings page is sound, of whatever version that is.
#include "serial.h"

#include <stdbool.h>

#include "../hal/flash.h"
#include "../src/flash_layout.h"
#include "../src/core/protocol.h"
#include "checksum.h"

static bool is_sound(uint16_t page)
{
    uint16_t covered = SETTINGS_GENERATION + flash_read(page + SETTINGS_LENGTH);
    return flash_read16(page) == SETTINGS_MAGIC &&
           checksum_of_flash(page, covered + CHECKSUM_BYTES) == CHECKSUM_OF_SOUND;
}

uint32_t serial_number(void)
{
    if (is_sound(SETTINGS_FIRST_PAGE))
        return flash_read32(SETTINGS_FIRST_PAGE + SETTINGS_SERIAL);
    return is_sound(SETTINGS_SECOND_PAGE) ? flash_read32(SETTINGS_SECOND_PAGE + SETTINGS_SERIAL) : SERIAL_NONE;
}
