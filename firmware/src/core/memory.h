// The 8051's memory spaces by SDCC's names. Other compilers, such as the one that builds the tests, have only one
// space.
#ifndef MEMORY_H
#define MEMORY_H

#ifndef __SDCC
#define __xdata
#define __code
#define __at(address)
#endif

#endif
