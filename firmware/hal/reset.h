// Why the chip was reset, and resetting it on purpose.
#ifndef RESET_H
#define RESET_H

#include <stdbool.h>
#include <stdint.h>

// Why the firmware itself reset the chip.
enum reset_note { NOTE_NONE, NOTE_RESET, NOTE_STACK, NOTE_UPDATE, NOTE_LOADER, NOTE_NOT_GREETED };

// Notes the reset's cause, and the note of the one who made it. To be called once.
void reset_start(void);

// The part of it that the loader needs, which leaves the cause and all other notes to the application: takes the note,
// if the reset was made with this one.
bool reset_take_note(uint8_t note);

// RSTSRC as it was found, but no other bit beside that of a power-up.
uint8_t reset_cause(void);

// The enum reset_note that this reset was made with.
uint8_t reset_note(void);

// Resets the chip, and leaves an enum reset_note to who starts then.
void reset_now(uint8_t note);

#endif
