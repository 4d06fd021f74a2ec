// A flash that may lose its power at any operation, and stand-ins for what else the firmware's code for flash calls.
#include "failing_flash.h"

#include "../../firmware/hal/flash.h"
#include "../../firmware/loader/checksum.h"
#include "../../firmware/src/core/crc.h"
#include "../../firmware/src/core/protocol.h"

uint8_t flash[0x10000];
unsigned long operations;
unsigned long cut_at;
enum outcome outcome;
uint32_t noise;
jmp_buf power_fails;

uint32_t draw(void)
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
struct plan plan_in_force;
struct calibration calibration_in_force;
int16_t trim_in_force;

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

uint8_t memory[MEMORY_BYTES];

const uint8_t *ring_memory(void)
{
    return memory;
}

const uint8_t *ring_memory_end(void)
{
    return memory + sizeof memory;
}
