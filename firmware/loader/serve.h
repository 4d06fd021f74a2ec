// The loader at the line: takes an image into staging, installs it, starts it.
#ifndef SERVE_H
#define SERVE_H

#include <stdint.h>

// Serves the line until the chip is reset; `reason` (enum stay) is why the application was not started. Flash must be
// writable.
void serve(uint8_t reason);

#endif
