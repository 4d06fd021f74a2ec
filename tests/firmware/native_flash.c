// The firmware's own code for flash, loader and application, under gcc on a flash that may lose its power at any
// operation.
//
// Each case begins with what flash holds at a power-up and runs a piece of the firmware: a boot, a STORE, an install.
// The power fails at each operation of it, in all ways that the operation can be left: not done, done, or half (some
// bits of a byte, some bits of a page). Then the unit recovers, and the power fails a second time, at each operation of
// that. What must hold is checked after the power-up that nothing disturbs.
//
//   native_flash boot|store|stage|install BYTES STEP STRIDE
//
// BYTES is the length of the image; the first cut is at every STEP-th operation, the second at every STRIDE-th (0:
// none). Prints the states tried, or the first that is wrong, and then ends with 1.
#include <setjmp.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../../firmware/hal/flash.h"
#include "../../firmware/loader/application.h"
#include "../../firmware/loader/checksum.h"
#include "../../firmware/loader/image.h"
#include "../../firmware/loader/install.h"
#include "../../firmware/loader/page.h"
#include "../../firmware/src/boot_number.h"
#include "../../firmware/src/core/calibration.h"
#include "../../firmware/src/core/plan.h"
#include "../../firmware/src/core/protocol.h"
#include "../../firmware/src/flash_layout.h"
#include "../../firmware/src/life.h"
#include "../../firmware/src/settings.h"
#include "failing_flash.h"

// ---- the walk through all cuts

struct piece {
    void (*run)(void); // what the power cuts off
    void (*recover)(void); // what the unit does next, and the second cut falls in
    void (*settle)(void); // what a power-up runs that nothing disturbs
    const char *(*wrong)(void); // what must not be after it; NULL if all is well
};

static unsigned long states;
static uint8_t before[sizeof flash];

static bool runs_whole(void (*part)(void), unsigned long cut)
{
    operations = 0;
    cut_at = cut;
    for (unsigned i = 0; i < sizeof memory; i++)
        memory[i] = (uint8_t)draw(); // a power-up finds other memory
    if (setjmp(power_fails) != 0)
        return false;
    part();
    return true;
}

// A power-up that nothing disturbs, after a cut at operation `first`, and perhaps one of its recovery.
static void settle(const struct piece *piece, unsigned long first, unsigned long second)
{
    runs_whole(piece->settle, 0);
    states++;
    const char *wrong = piece->wrong();
    if (wrong == NULL)
        return;
    printf("%s, after cuts at operations %lu and %lu, outcome %d\n", wrong, first, second, outcome);
    exit(1);
}

// A second cut at every `stride`-th operation of the recovery from what flash holds now.
static void cut_recovery(const struct piece *piece, unsigned long first, unsigned long stride)
{
    static uint8_t cut[sizeof flash];
    int first_outcome = outcome;
    memcpy(cut, flash, sizeof flash);
    runs_whole(piece->recover, 0);
    unsigned long last = operations;
    for (unsigned long second = 1; second <= last; second += stride)
        for (int how = NOT_DONE; how < OUTCOMES; how++) {
            memcpy(flash, cut, sizeof flash);
            outcome = how;
            runs_whole(piece->recover, second);
            settle(piece, first, second);
        }
    outcome = first_outcome;
}

// A cut at every `step`-th operation, alone and with a second one at every `stride`-th of the recovery (0: none).
static void cut_everywhere(const struct piece *piece, unsigned long step, unsigned long stride)
{
    memcpy(before, flash, sizeof flash);
    runs_whole(piece->run, 0);
    unsigned long last = operations;
    for (unsigned long first = 1; first <= last; first += step)
        for (int how = NOT_DONE; how < OUTCOMES; how++) {
            outcome = how;
            if (stride != 0) {
                memcpy(flash, before, sizeof flash);
                runs_whole(piece->run, first);
                cut_recovery(piece, first, stride);
            }
            memcpy(flash, before, sizeof flash);
            runs_whole(piece->run, first);
            settle(piece, first, 0);
        }
    memcpy(flash, before, sizeof flash);
}

// ---- a boot: its number is counted, its life drawn

#define BOOT_FIRST_PAGE 0xF200
#define BOOT_SECOND_PAGE 0xF400
#define LIFE_PAGE 0xF000
#define BOOTS_PER_PAGE 4064
#define LIFE 0x12345678U

static uint16_t number;
static uint16_t number_before;
static bool has_life; // flash held one when the power first failed

static void boot(void)
{
    number = boot_number_count();
    life_start();
}

static const char *boot_is_wrong(void)
{
    uint16_t ahead = number - number_before;
    uint32_t life = life_number();
    uint16_t last = number;
    if (has_life && life != LIFE)
        return "another life";
    if (ahead < 1 || ahead > 3)
        return "a boot number that was used before, or is far ahead";
    if (!runs_whole(boot, 0) || life_number() != life || number != (uint16_t)(last + 1))
        return "the next boot is not the next of this life";
    return NULL;
}

static void put_boot_page(uint16_t page, uint16_t base, unsigned boots)
{
    uint16_t header[] = {base, (uint16_t)~base};
    memset(flash + page, 0xFF, FLASH_PAGE_BYTES);
    memcpy(flash + page, header, sizeof header);
    for (unsigned boot = 0; boot < boots; boot++)
        flash[page + sizeof header + boot / 8] &= ~(1 << boot % 8);
}

static void cut_boots(unsigned long step, unsigned long stride)
{
    static const struct piece piece = {boot, boot, boot, boot_is_wrong};
    static const unsigned counted[] = {0, 1, 7, 8, 9, 2000, BOOTS_PER_PAGE - 1, BOOTS_PER_PAGE};
    uint32_t life[] = {LIFE, ~LIFE};
    for (unsigned i = 0; i < sizeof counted / sizeof *counted; i++)
        for (int other_is_used = 0; other_is_used < 2; other_is_used++) {
            memset(flash, 0xFF, sizeof flash);
            put_boot_page(BOOT_FIRST_PAGE, 0x1000, counted[i]);
            if (other_is_used)
                put_boot_page(BOOT_SECOND_PAGE, 0x1000 - BOOTS_PER_PAGE, BOOTS_PER_PAGE);
            memcpy(flash + LIFE_PAGE, life, sizeof life);
            number_before = 0x1000 + counted[i];
            has_life = true;
            cut_everywhere(&piece, step, stride);
        }
    memset(flash, 0xFF, sizeof flash); // a chip's first boot
    number_before = 0;
    has_life = false;
    cut_everywhere(&piece, step, stride);
}

// ---- STORE: the old settings or the new

#define SERIAL 0xC0FFEE01U

static const struct plan plans[] = {
    {.first_bearing = -100, .bearing_step = 1, .count = 2, .ping_interval_ms = 30, .top_speed = 100, .pings = 1},
    {.first_bearing = 100,
     .bearing_step = 257,
     .count = 9,
     .ping_interval_ms = 513,
     .top_speed = 666,
     .ramp_ms = 257,
     .pings = 5},
};
static const struct calibration calibrations[] = {
    {.half_steps_per_turn = 0x00FF00FF, .backlash = 3, .home = 0, .home_bearing = -30000},
    {.half_steps_per_turn = 0x0000FF00, .backlash = 60, .home = 1, .home_bearing = -27307},
};
static const int16_t trims[] = {-7, 700};

static void start_with_defaults(void)
{
    plan_in_force = plan_default;
    calibration_in_force = calibration_default;
    trim_in_force = 0x7FFF;
    settings_start();
}

static void set(int which)
{
    plan_in_force = plans[which];
    calibration_in_force = calibrations[which];
    trim_in_force = trims[which];
}

static bool settings_are(int which)
{
    static uint8_t found[SETTINGS_BYTES];
    memcpy(found, settings_bytes(), sizeof found);
    struct plan plan = plan_in_force;
    struct calibration calibration = calibration_in_force;
    int16_t trim = trim_in_force;
    set(which);
    bool same = memcmp(found, settings_bytes(), sizeof found) == 0;
    plan_in_force = plan;
    calibration_in_force = calibration;
    trim_in_force = trim;
    return same;
}

static void store_new(void)
{
    start_with_defaults();
    set(1);
    settings_store();
}

static bool was_stored; // before the cut; else the defaults hold

static const char *store_is_wrong(void)
{
    if (settings_serial() != SERIAL)
        return "another serial number";
    bool is_old = was_stored ? settings_are(0)
                             : plan_in_force.count == plan_default.count && trim_in_force == 0x7FFF &&
                                   calibration_in_force.backlash == calibration_default.backlash;
    if (!is_old && !settings_are(1))
        return "settings neither old nor new";
    store_new();
    start_with_defaults();
    return settings_are(1) && settings_serial() == SERIAL ? NULL : "the next STORE does not hold";
}

// As a unit is flashed: a page that ends after the serial number, and zeros that make the other one unsound.
static void flash_unit(void)
{
    uint8_t page[] = {0x43, 0x4E, 2, 6, 0, 0, SERIAL & 0xFF, SERIAL >> 8 & 0xFF, SERIAL >> 16 & 0xFF, SERIAL >> 24};
    memset(flash, 0xFF, sizeof flash);
    memcpy(flash + SETTINGS_FIRST_PAGE, page, sizeof page);
    uint32_t crc = checksum_of_flash(SETTINGS_FIRST_PAGE, sizeof page);
    memcpy(flash + SETTINGS_FIRST_PAGE + sizeof page, &crc, sizeof crc);
    memset(flash + SETTINGS_SECOND_PAGE, 0, 2);
}

static void cut_stores(unsigned long step, unsigned long stride)
{
    static const struct piece piece = {store_new, store_new, start_with_defaults, store_is_wrong};
    for (int stores = 0; stores < 3; stores++) { // first ever, and from either page
        flash_unit();
        for (int store = 0; store < stores; store++) {
            start_with_defaults();
            set(0);
            settings_store();
        }
        was_stored = stores > 0;
        cut_everywhere(&piece, step, stride);
    }
}

// ---- an update: the old application or the new

static unsigned image_bytes;
static uint8_t images[2][sizeof(uint16_t) + 0x7000];

static void put_image(uint16_t base, uint8_t version)
{
    uint8_t description[16] = {0x49, 0x4E, IMAGE_HARDWARE, version, 0, 0, image_bytes & 0xFF, image_bytes >> 8};
    noise = version;
    for (unsigned i = 0; i < image_bytes; i++)
        flash[base + i] = (uint8_t)draw();
    uint32_t crc = checksum_of_flash(base, image_bytes);
    memcpy(description + 8, &crc, sizeof crc);
    memcpy(flash + base + DESCRIPTION, description, 12);
    crc = checksum_of_flash(base + DESCRIPTION, 12);
    memcpy(flash + base + DESCRIPTION_CRC, &crc, sizeof crc);
    memcpy(images[version - 1], flash + base, image_bytes);
}

static void start_install(void)
{
    install();
}

// As loader/main.c does it.
static void load(void)
{
    uint8_t obstacle = application_obstacle();
    if (obstacle == STAY_NO_APPLICATION && install() == RESULT_DONE)
        obstacle = application_obstacle();
    if (obstacle == STAY_NONE)
        application_start();
}

static bool holds(uint8_t version)
{
    return image_is_sound(APPLICATION) && flash[APPLICATION + DESCRIPTION_VERSION] == version &&
           memcmp(flash + APPLICATION, images[version - 1], image_bytes) == 0;
}

static const char *install_is_wrong(void)
{
    return holds(1) || holds(2) ? NULL : "the application is neither the old one nor the new";
}

static void program_staging(void)
{
    for (unsigned page = 0; page < image_bytes; page += FLASH_PAGE_BYTES) {
        for (unsigned i = 0; i < FLASH_PAGE_BYTES; i++)
            page_image[i] = (uint8_t)draw();
        page_program(STAGING + page);
    }
}

static const char *stage_is_wrong(void)
{
    return holds(1) ? NULL : "the old application does not hold";
}

static void cut_update(bool is_staged, unsigned long step, unsigned long stride)
{
    static const struct piece installing = {start_install, load, load, install_is_wrong};
    static const struct piece staging = {program_staging, program_staging, load, stage_is_wrong};
    memset(flash, 0xFF, sizeof flash);
    put_image(APPLICATION, 1);
    flash[APPLICATION + DESCRIPTION_CONFIRMED] = 0;
    if (is_staged)
        put_image(STAGING, 2);
    noise = 1;
    cut_everywhere(is_staged ? &installing : &staging, step, stride);
}

int main(int count, char **arguments)
{
    if (count != 5)
        return 2;
    image_bytes = atoi(arguments[2]);
    unsigned long step = atoi(arguments[3]);
    unsigned long stride = atoi(arguments[4]);
    noise = 1;
    if (strcmp(arguments[1], "boot") == 0)
        cut_boots(step, stride);
    else if (strcmp(arguments[1], "store") == 0)
        cut_stores(step, stride);
    else
        cut_update(strcmp(arguments[1], "install") == 0, step, stride);
    printf("%lu\n", states);
    return 0;
}
