// Why the chip was reset (datasheet chapter "Reset Sources").
#include "reset.h"

#include "chip.h"

#define LETTER_MAGIC_LOW 0x4E
#define LETTER_MAGIC_HIGH 0x4F

static __xdata uint8_t cause;
static __xdata uint8_t found;

// Memory that no start-up clears, the loader's neither: what one who resets the chip has to say to the next.
static volatile __xdata __at(0x0406) struct {
    uint8_t magic_low;
    uint8_t magic_high;
    uint8_t note;
    uint8_t complement;
} letter;

bool reset_take_note(uint8_t note)
{
    if (letter.magic_low != LETTER_MAGIC_LOW || letter.magic_high != LETTER_MAGIC_HIGH || letter.note != note ||
        letter.complement != (uint8_t)~note)
        return false;
    letter.magic_low = 0;
    return true;
}

void reset_start(void)
{
    uint8_t note = letter.note;
    cause = RSTSRC;
    if (cause & RSTSRC_PORSF)
        cause = RSTSRC_PORSF; // after a power-up the other bits mean nothing
    found = reset_take_note(note) ? note : NOTE_NONE;
}

uint8_t reset_cause(void)
{
    return cause;
}

uint8_t reset_note(void)
{
    return found;
}

void reset_now(uint8_t note)
{
    letter.note = note;
    letter.complement = ~note;
    letter.magic_high = LETTER_MAGIC_HIGH;
    letter.magic_low = LETTER_MAGIC_LOW;
    for (;;)
        RSTSRC = RSTSRC_PORSF | RSTSRC_SWRSF;
}
