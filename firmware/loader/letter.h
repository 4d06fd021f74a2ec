// The letter across resets, as ../README.md describes it: the application's wish that the loader stay, and the loader's word that it
// was the loader who reset the chip.
#ifndef LETTER_H
#define LETTER_H

#include <stdbool.h>

// Whether the application asks the loader to stay. The letter is wiped then; any other is left to the application.
bool letter_asks_to_stay(void);

// Leaves word for the application, to be read after a reset.
void letter_write_updated(void);

#endif
