// The life's page is `life:u32 complement:u32`. A life is taken up only when it is whole, and never again once its page
// has been erased: so no power cut lets two lives have the same boot number, or one life two.
#include "life.h"

#include <stdbool.h>

#include "../hal/flash.h"
#include "core/crc.h"
#include "core/memory.h"
#include "core/ring.h"

#define PAGE 0xF000

static __xdata uint32_t life;

static void write32(uint16_t address, uint32_t value)
{
    flash_write16(address, (uint16_t)value);
    flash_write16(address + 2, value >> 16);
}

static bool is_sound(void)
{
    return flash_read32(PAGE) != 0 && flash_read32(PAGE) == ~flash_read32(PAGE + 4);
}

// Of what the ring's memory holds: after a power-up that is noise, for each of its 24,000 cells falls to either side
// and many of them not always to the same; and an application that has run before leaves other sweeps there each time.
static uint32_t draw(void)
{
    uint32_t crc = CRC_EMPTY;
    for (const __xdata uint8_t *at = ring_memory(); at != ring_memory_end(); at++)
        crc = crc_add(crc, *at);
    crc = crc_end(crc);
    return crc != 0 ? crc : 1;
}

void life_end(void)
{
    flash_erase(PAGE);
}

void life_start(void)
{
    if (is_sound()) {
        life = flash_read32(PAGE);
        return;
    }
    life = draw(); // in force even if flash does not take it
    flash_erase(PAGE);
    write32(PAGE, life);
    write32(PAGE + 4, ~life);
}

uint32_t life_number(void)
{
    return life;
}
