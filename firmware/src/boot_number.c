// The boot number's page: `base:u16`, two bytes left erased, then one bit cleared per boot, lowest first.
#include "boot_number.h"

#include "../hal/flash.h"

#define PAGE 0xF400
#define FIRST_TALLY (PAGE + 4)
#define PAGE_END (PAGE + FLASH_PAGE_BYTES)
#define BOOTS_PER_PAGE ((FLASH_PAGE_BYTES - 4) * 8)
#define BASE_ERASED 0xFFFF

static uint16_t read_base(void)
{
    return flash_read(PAGE) | (uint16_t)flash_read(PAGE + 1) << 8;
}

static void write_base(uint16_t base)
{
    flash_write(PAGE, (uint8_t)base);
    flash_write(PAGE + 1, base >> 8);
}

uint16_t boot_number_count(void)
{
    uint16_t base = read_base();
    if (base == BASE_ERASED) {
        base = 0;
        write_base(base);
    }
    uint16_t tally = FIRST_TALLY;
    while (tally != PAGE_END && flash_read(tally) == 0)
        tally++;
    if (tally == PAGE_END) {
        base += BOOTS_PER_PAGE;
        flash_erase(PAGE);
        write_base(base);
        tally = FIRST_TALLY;
    }
    uint8_t unused = flash_read(tally);
    uint8_t rest = unused & (uint8_t)(unused - 1); // without its lowest bit
    flash_write(tally, rest);
    uint16_t boots = (tally - FIRST_TALLY) * 8;
    for (uint8_t cleared = ~rest; cleared != 0; cleared >>= 1)
        boots++;
    return base + boots;
}
