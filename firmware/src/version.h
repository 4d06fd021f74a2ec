// The firmware's version, as HELLO shows it.
#ifndef VERSION_H
#define VERSION_H

#define VERSION_MAJOR 0
#define VERSION_MINOR 6
#define VERSION_PATCH 0

#endif
