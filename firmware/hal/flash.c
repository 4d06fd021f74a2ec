// Flash (datasheet chapter "Flash Memory"): each operation is a MOVX, unlocked by two keys.
#include "flash.h"

#include "chip.h"
#include "supply.h"

static void operate(uint16_t address, uint8_t value, uint8_t mode)
{
    if (!supply_is_sound())
        return;
    __critical
    {
        FLKEY = 0xA5;
        FLKEY = 0xF1;
        PSCTL = mode; // from here on any MOVX would go to flash, a service routine's too: this is the only one
        *(__xdata volatile uint8_t *)address = value;
        PSCTL = 0;
    }
}

uint8_t flash_read(uint16_t address)
{
    return *(const __code uint8_t *)address;
}

uint16_t flash_read16(uint16_t address)
{
    return *(const __code uint16_t *)address;
}

uint32_t flash_read32(uint16_t address)
{
    return *(const __code uint32_t *)address;
}

void flash_write(uint16_t address, uint8_t value)
{
    operate(address, value, PSCTL_PSWE);
}

void flash_write16(uint16_t address, uint16_t value)
{
    flash_write(address, (uint8_t)value);
    flash_write(address + 1, value >> 8);
}

void flash_erase(uint16_t address)
{
    operate(address, 0, PSCTL_PSWE | PSCTL_PSEE);
}
