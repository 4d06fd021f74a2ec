// The firmware's own code for flash, loader and application, under gcc on a flash that may lose its power at any operation.
//
// Each case begins with what flash holds at a power-up and runs a piece of the firmware: a boot, a STORE, an install. The
// power fails at operation n of it, in all ways that it can be left: not done, done, or half (some bits of a byte, some bits
// of a page). Then the unit recovers; and for each of its operations there is a second cut, and a second recovery, which
// nothing disturbs. What must hold is checked after each power-up.
//
//   native_flash boot|store|install LIMIT    prints the states tried; exits 1 with the first state that is wrong
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
#include "../../firmware/src/boot_number.h"
#include "../../firmware/src/core/crc.h"
#include "../../firmware/src/core/protocol.h"
#include "../../firmware/src/flash_layout.h"
#include "../../firmware/src/life.h"
#include "../../firmware/src/settings.h"

// ---- a flash that fails

static uint8_t flash[0x10000];
static unsigned long operations; // since power-up
static unsigned long cut_at; // the operation at which the power fails; 0: never
static enum { NOT_DONE, DONE, HALF, OUTCOMES } outcome;
static uint32_t noise;
static jmp_buf power_fails;

static uint32_t draw(void)
{
    noise ^= noise << 13;
    noise ^= noise >> 17;
    noise ^= noise << 5;
    return noise;
}

static uint8_t left_of(uint8_t before, uint8_t after)
{
    if (outcome == HALF)
        return (uint8_t)(before ^ ((before ^ after) & draw()));
    return outcome == DONE ? after : before;
}

static void operate(uint16_t first, unsigned length, uint8_t keep, uint8_t set)
{
    bool fails = ++operations == cut_at;
    for (unsigned i = 0; i < length; i++) {
        uint8_t *cell = flash + first + i;
        uint8_t after = (*cell & keep) | set;
        *cell = fails ? left_of(*cell, after) : after;
    }
    if (fails)
        longjmp(power_fails, 1);
}

uint8_t flash_read(uint16_t address)
{
    return flash[address];
}

uint16_t flash_read16(uint16_t address)
{
    return flash[address] | flash[address + 1] << 8;
}

uint32_t flash_read32(uint16_t address)
{
    return flash_read16(address) | (uint32_t)flash_read16(address + 2) << 16;
}

void flash_write(uint16_t address, uint8_t value)
{
    operate(address, 1, value, 0);
}

void flash_write16(uint16_t address, uint16_t value)
{
    flash_write(address, (uint8_t)value);
    flash_write(address + 1, value >> 8);
}

void flash_erase(uint16_t address)
{
    operate(address & ~(FLASH_PAGE_BYTES - 1), FLASH_PAGE_BYTES, 0xFF, 0xFF);
}

// ---- what the firmware's code needs of the rest

static uint32_t sum;
static struct plan plan_in_force;
static struct calibration calibration_in_force;
static int16_t trim_in_force;

void checksum_begin(void)
{
    sum = CRC_EMPTY;
}

void checksum_add(uint8_t byte)
{
    sum = crc_add(sum, byte);
}

uint32_t checksum(void)
{
    return crc_end(sum);
}

uint32_t checksum_of_flash(uint16_t address, uint16_t length)
{
    checksum_begin();
    for (unsigned i = 0; i < length; i++)
        checksum_add(flash[(uint16_t)(address + i)]);
    return checksum();
}

void watchdog_feed(void)
{
}

void watchdog_start(void)
{
}

void watchdog_stop(void)
{
}

void timebase_await_early(void)
{
}

const struct plan *unit_plan(void)
{
    return &plan_in_force;
}

const struct calibration *unit_calibration(void)
{
    return &calibration_in_force;
}

uint8_t unit_configure(const struct plan *plan)
{
    plan_in_force = *plan;
    return RESULT_DONE;
}

uint8_t unit_calibrate(const struct calibration *calibration)
{
    calibration_in_force = *calibration;
    return RESULT_DONE;
}

int16_t thermometer_trim(void)
{
    return trim_in_force;
}

void thermometer_set_trim(int16_t trim)
{
    trim_in_force = trim;
}

static uint8_t memory[64]; // the ring's, of which a life is drawn

const uint8_t *ring_memory(void)
{
    return memory;
}

const uint8_t *ring_memory_end(void)
{
    return memory + sizeof memory;
}

// ---- the walk through all cuts

struct piece {
    void (*run)(void); // what the power cuts off
    void (*recover)(void); // what a power-up runs
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

static void judge(const struct piece *piece, const char *when, unsigned long first, unsigned long second)
{
    states++;
    const char *wrong = piece->wrong();
    if (wrong == NULL)
        return;
    printf("%s after a cut at operation %lu (outcome %d) and %lu: %s\n", wrong, first, outcome, second, when);
    exit(1);
}

// A second cut at every operation of the recovery from what flash holds now.
static void cut_recovery(const struct piece *piece, unsigned long first, unsigned long stride)
{
    static uint8_t cut[sizeof flash];
    memcpy(cut, flash, sizeof flash);
    int first_outcome = outcome;
    bool whole = runs_whole(piece->recover, 0);
    unsigned long last = operations;
    if (whole)
        judge(piece, "recovered", first, 0);
    for (unsigned long second = 1; second <= last; second += stride)
        for (int how = NOT_DONE; how < OUTCOMES; how++) {
            memcpy(flash, cut, sizeof flash);
            outcome = how;
            runs_whole(piece->recover, second);
            runs_whole(piece->recover, 0);
            judge(piece, "recovered twice", first, second);
        }
    outcome = first_outcome;
}

// Cuts at every operation, with a second cut at every `stride`-th one of each recovery (0: none).
static void cut_everywhere(const struct piece *piece, unsigned long step, unsigned long stride)
{
    memcpy(before, flash, sizeof flash);
    runs_whole(piece->run, 0);
    unsigned long last = operations;
    for (unsigned long first = 1; first <= last; first += step)
        for (int how = NOT_DONE; how < OUTCOMES; how++) {
            memcpy(flash, before, sizeof flash);
            outcome = how;
            runs_whole(piece->run, first);
            if (stride != 0) {
                cut_recovery(piece, first, stride);
            } else {
                runs_whole(piece->recover, 0);
                judge(piece, "recovered", first, 0);
            }
        }
    memcpy(flash, before, sizeof flash);
}
