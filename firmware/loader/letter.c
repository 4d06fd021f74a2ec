// The letter across resets: `0x4E 0x4F note ~note` between the ring's control and its memory in XRAM.
#include "letter.h"

#include <stdint.h>

#include "../src/protocol.h"

static volatile __xdata __at(0x0406) uint8_t letter[4];

bool letter_asks_to_stay(void)
{
    bool asks = letter[0] == 0x4E && letter[1] == 0x4F && letter[2] == NOTE_UPDATE && letter[3] == (uint8_t)~NOTE_UPDATE;
    if (asks)
        letter[0] = 0;
    return asks;
}

void letter_write_updated(void)
{
    letter[0] = 0x4E;
    letter[1] = 0x4F;
    letter[2] = NOTE_LOADER;
    letter[3] = (uint8_t)~NOTE_LOADER;
}
