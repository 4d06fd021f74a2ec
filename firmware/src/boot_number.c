// A boot number's page: `base:u16 complement:u16`, then one bit cleared per boot, lowest first. The sound page of the
// higher base holds, and the other one is begun when it is used up. So the number never goes back wherever the power
// fails: a bit is cleared or not; an erase under way sets bits, and a page of which base or complement has gained one
// is not sound; nor is one whose base or complement is not written yet.
#include "boot_number.h"

#include <stdbool.h>

#include "../hal/flash.h"
#include "life.h"

#define FIRST_PAGE 0xF200
#define SECOND_PAGE 0xF400
#define HEADER_BYTES 4
#define BOOTS_PER_PAGE ((FLASH_PAGE_BYTES - HEADER_BYTES) * 8)

static uint16_t base_of(uint16_t page)
{
    return flash_read16(page);
}

static bool is_sound(uint16_t page)
{
    return flash_read16(page + 2) == (uint16_t)~base_of(page);
}

static uint16_t begin(uint16_t page, uint16_t base)
{
    flash_erase(page);
    flash_write16(page, base);
    flash_write16(page + 2, ~base);
    return page;
}

static uint16_t begin_again(void)
{
    life_end();
    return begin(FIRST_PAGE, 0);
}

static uint16_t page_that_holds(void)
{
    if (!is_sound(SECOND_PAGE))
        return is_sound(FIRST_PAGE) ? FIRST_PAGE : begin_again();
    if (is_sound(FIRST_PAGE) && (int16_t)(base_of(FIRST_PAGE) - base_of(SECOND_PAGE)) > 0)
        return FIRST_PAGE;
    return SECOND_PAGE;
}

// The first byte that has a bit left, or the page's end.
static uint16_t first_unused(uint16_t page)
{
    uint16_t tally = page + HEADER_BYTES;
    while (tally != page + FLASH_PAGE_BYTES && flash_read(tally) == 0)
        tally++;
    return tally;
}

uint16_t boot_number_count(void)
{
    uint16_t page = page_that_holds();
    uint16_t tally = first_unused(page);
    if (tally == page + FLASH_PAGE_BYTES) {
        page = begin(page == FIRST_PAGE ? SECOND_PAGE : FIRST_PAGE, base_of(page) + BOOTS_PER_PAGE);
        tally = page + HEADER_BYTES;
    }
    uint8_t unused = flash_read(tally);
    uint8_t rest = unused & (uint8_t)(unused - 1); // without its lowest bit
    flash_write(tally, rest);
    uint16_t boots = (tally - page - HEADER_BYTES) * 8;
    for (uint8_t cleared = ~rest; cleared != 0; cleared >>= 1)
        boots++;
    return base_of(page) + boots;
}
