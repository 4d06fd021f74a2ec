// The settings pages, used by turns (../README.md, Flash). The page that does not hold is erased and written again, its
// CRC last: until that is whole the other one holds, and the power may fail at any moment.
#include "settings.h"

#include "../hal/flash.h"
#include "../hal/timebase.h"
#include "../hal/watchdog.h"
#include "core/crc.h"
#include "core/little_endian.h"
#include "core/protocol.h"
#include "core/wire_layout.h"
#include "flash_layout.h"
#include "thermometer.h"
#include "unit.h"

#define NO_PAGE 0
#define VERSION 2
#define CONTENT (SETTINGS_SERIAL + 4) // plan, calibration and trim
#define SHORTEST_LENGTH (CONTENT - SETTINGS_GENERATION)
#define LENGTH (SHORTEST_LENGTH + SETTINGS_BYTES)

#define OFFSET_CALIBRATION LAYOUT_PLAN_BYTES
#define OFFSET_TRIM (LAYOUT_PLAN_BYTES + LAYOUT_CALIBRATION_BYTES)

static __xdata uint16_t page; // the one that holds
static __xdata uint8_t in_force[SETTINGS_BYTES];
static __xdata uint8_t stored[SETTINGS_BYTES]; // what flash holds, defaults where it holds nothing

// Of the page being written.
static __xdata uint16_t at;
static __xdata uint32_t crc;

static bool is_sound(uint16_t candidate)
{
    uint8_t length = flash_read(candidate + SETTINGS_LENGTH);
    uint16_t end = candidate + SETTINGS_GENERATION + length;
    uint32_t sum = CRC_EMPTY;
    if (flash_read16(candidate) != SETTINGS_MAGIC || flash_read(candidate + SETTINGS_VERSION) != VERSION ||
        length < SHORTEST_LENGTH)
        return false;
    for (uint16_t address = candidate; address != end; address++)
        sum = crc_add(sum, flash_read(address));
    sum = crc_end(sum);
    return flash_read16(end) == (uint16_t)sum && flash_read16(end + 2) == sum >> 16;
}

static uint16_t generation_of(uint16_t candidate)
{
    return flash_read16(candidate + SETTINGS_GENERATION);
}

static uint16_t page_that_holds(void)
{
    if (!is_sound(SETTINGS_SECOND_PAGE))
        return is_sound(SETTINGS_FIRST_PAGE) ? SETTINGS_FIRST_PAGE : NO_PAGE;
    if (is_sound(SETTINGS_FIRST_PAGE) &&
        (int16_t)(generation_of(SETTINGS_FIRST_PAGE) - generation_of(SETTINGS_SECOND_PAGE)) > 0)
        return SETTINGS_FIRST_PAGE;
    return SETTINGS_SECOND_PAGE;
}

static void hand_out(void)
{
    static __xdata struct plan plan;
    static __xdata struct calibration calibration;
    layout_read_plan(&plan, in_force);
    layout_read_calibration(&calibration, in_force + OFFSET_CALIBRATION);
    plan_ease(&plan);
    unit_configure(&plan); // refuses what no unit can do, and goes on with what it has
    unit_calibrate(&calibration);
    thermometer_set_trim(get16(in_force + OFFSET_TRIM));
}

static void keep_in_mind(void)
{
    for (uint8_t i = 0; i < SETTINGS_BYTES; i++)
        stored[i] = in_force[i];
}

void settings_start(void)
{
    page = page_that_holds();
    settings_bytes();
    if (page != NO_PAGE) {
        uint8_t held = flash_read(page + SETTINGS_LENGTH) - SHORTEST_LENGTH;
        for (uint8_t i = 0; i < SETTINGS_BYTES && i < held; i++)
            in_force[i] = flash_read(page + CONTENT + i);
    }
    keep_in_mind(); // first: what is handed out may differ
    hand_out();
}

uint32_t settings_serial(void)
{
    if (page == NO_PAGE)
        return SERIAL_NONE;
    return flash_read16(page + SETTINGS_SERIAL) | (uint32_t)flash_read16(page + SETTINGS_SERIAL + 2) << 16;
}

const __xdata uint8_t *settings_bytes(void)
{
    layout_write_plan(in_force, unit_plan());
    layout_write_calibration(in_force + OFFSET_CALIBRATION, unit_calibration());
    put16(in_force + OFFSET_TRIM, thermometer_trim());
    return in_force;
}

bool settings_are_stored(void)
{
    settings_bytes();
    for (uint8_t i = 0; i < SETTINGS_BYTES; i++)
        if (in_force[i] != stored[i])
            return false;
    return true;
}

static void write8(uint8_t value)
{
    flash_write(at++, value);
    crc = crc_add(crc, value);
}

static void write16(uint16_t value)
{
    write8((uint8_t)value);
    write8(value >> 8);
}

static void write32(uint32_t value)
{
    write16((uint16_t)value);
    write16(value >> 16);
}

static void write_page(uint16_t generation)
{
    uint32_t serial = settings_serial();
    crc = CRC_EMPTY;
    write16(SETTINGS_MAGIC);
    write8(VERSION);
    write8(LENGTH);
    write16(generation);
    write32(serial);
    for (uint8_t i = 0; i < SETTINGS_BYTES; i++)
        write8(in_force[i]);
    write32(crc_end(crc));
}

// The erase takes longer than the watchdog's time, and writing and checking after it more than a third of that.
static void erase_and_write(uint16_t victim, uint16_t generation)
{
    watchdog_stop();
    timebase_await_early(); // a wrap that has passed unseen would set the clock back by 16.4 ms
    flash_erase(victim);
    at = victim;
    write_page(generation);
    watchdog_start();
}

bool settings_store(void)
{
    uint16_t other = page == SETTINGS_FIRST_PAGE ? SETTINGS_SECOND_PAGE : SETTINGS_FIRST_PAGE;
    uint16_t generation = page == NO_PAGE ? 1 : generation_of(page) + 1;
    settings_bytes();
    erase_and_write(other, generation);
    if (!is_sound(other) || generation_of(other) != generation)
        return false;
    page = other;
    keep_in_mind();
    return true;
}
