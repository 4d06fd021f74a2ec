// The application: whether it may be started, by its description, and starting it.
#include "application.h"

#include "../hal/flash.h"
#include "../src/core/protocol.h"
#include "image.h"

#define ATTEMPTS (APPLICATION + DESCRIPTION_ATTEMPTS)
#define CONFIRMED (APPLICATION + DESCRIPTION_CONFIRMED)

uint8_t application_obstacle(void)
{
    if (!image_is_sound(APPLICATION))
        return STAY_NO_APPLICATION;
    return flash_read(CONFIRMED) != 0 && flash_read(ATTEMPTS) == 0 ? STAY_NOT_CONFIRMED : STAY_NONE;
}

void application_start(void)
{
    if (flash_read(CONFIRMED) != 0) {
        uint8_t left = flash_read(ATTEMPTS);
        flash_write(ATTEMPTS, left & (uint8_t)(left - 1)); // without its lowest bit
    }
    __asm__("ljmp 0x1000");
}
