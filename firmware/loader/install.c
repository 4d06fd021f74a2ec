// Staging copied over the application. The application's description goes first and comes last: while it is not there,
// the loader finds no sound application after a reset and makes the copy again.
#include "install.h"

#include <stdbool.h>

#include "../src/core/protocol.h"
#include "image.h"
#include "page.h"

#define LAST_PAGE ((IMAGE_PAGES - 1) * FLASH_PAGE_BYTES)
#define DESCRIPTION_IN_PAGE (DESCRIPTION - LAST_PAGE)

static bool copy_pages(uint16_t length)
{
    for (uint16_t page = 0; page < length && page != LAST_PAGE; page += FLASH_PAGE_BYTES) {
        page_load(STAGING + page);
        if (!page_program(APPLICATION + page))
            return false;
    }
    page_load(STAGING + LAST_PAGE);
    for (uint16_t i = DESCRIPTION_IN_PAGE; i < FLASH_PAGE_BYTES; i++)
        page_image[i] = 0xFF;
    return page_program(APPLICATION + LAST_PAGE);
}

// Leaves attempts and confirmation erased, whatever staging has there.
static void copy_description(void)
{
    for (uint16_t offset = DESCRIPTION; offset < DESCRIPTION_ATTEMPTS; offset++)
        flash_write(APPLICATION + offset, flash_read(STAGING + offset));
}

uint8_t install(void)
{
    if (!image_is_sound(STAGING))
        return RESULT_BAD_CRC;
    if (flash_read(STAGING + DESCRIPTION_HARDWARE) != IMAGE_HARDWARE)
        return RESULT_NOT_FOR_THIS_UNIT;
    page_erase(APPLICATION + LAST_PAGE);
    if (!copy_pages(image_length(STAGING)))
        return RESULT_FLASH_FAILED;
    copy_description();
    return image_is_sound(APPLICATION) ? RESULT_DONE : RESULT_FLASH_FAILED;
}
