// The interrupt vectors (datasheet chapter "CIP-51", interrupt summary): vector n is at 3 + 8 n here, and as far
// into the application there, since SDCC begins the application with its vectors.
#include "vectors.h"

#define PASS_ON(number)                                                                                                \
    VECTOR(number)                                                                                                     \
    {                                                                                                                  \
        __asm__("ljmp 0x1003 + (8 * " #number ")");                                                                    \
    }

PASS_ON(0)
PASS_ON(1)
PASS_ON(2)
PASS_ON(3)
PASS_ON(4)
PASS_ON(5)
PASS_ON(6)
PASS_ON(7)
PASS_ON(8)
PASS_ON(9)
PASS_ON(10)
PASS_ON(11)
PASS_ON(12)
PASS_ON(13)
PASS_ON(14)
PASS_ON(15)
PASS_ON(16)
