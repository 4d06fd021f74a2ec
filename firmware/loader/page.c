// A page of flash that is made to hold an image: erased, written, compared.
#include "page.h"

#include "../hal/watchdog.h"
#include "checksum.h"

#define ERASED 0xFF

__xdata uint8_t page_image[FLASH_PAGE_BYTES];

void page_load(uint16_t address)
{
    for (uint16_t i = 0; i < FLASH_PAGE_BYTES; i++)
        page_image[i] = flash_read(address + i);
}

uint32_t page_crc(void)
{
    checksum_begin();
    for (uint16_t i = 0; i < FLASH_PAGE_BYTES; i++)
        checksum_add(page_image[i]);
    return checksum();
}

static bool holds_image(uint16_t address)
{
    for (uint16_t i = 0; i < FLASH_PAGE_BYTES; i++)
        if (flash_read(address + i) != page_image[i])
            return false;
    return true;
}

void page_erase(uint16_t address)
{
    watchdog_feed();
    flash_erase(address);
    watchdog_feed();
}

bool page_program(uint16_t address)
{
    watchdog_feed();
    if (holds_image(address))
        return true;
    page_erase(address);
    for (uint16_t i = 0; i < FLASH_PAGE_BYTES; i++) {
        watchdog_feed(); // all of them together take up to 36 ms
        if (page_image[i] != ERASED)
            flash_write(address + i, page_image[i]);
    }
    return holds_image(address);
}
