// Staging copied over the application, so that a power cut at any moment leaves one of the two.
#ifndef INSTALL_H
#define INSTALL_H

#include <stdint.h>

// RESULT_DONE, or why there is no copy: RESULT_BAD_CRC or RESULT_NOT_FOR_THIS_UNIT if staging has nothing to copy (and
// the application is untouched), RESULT_FLASH_FAILED if the flash does not hold the copy. May be called again after
// each. Flash must be writable.
uint8_t install(void);

#endif
