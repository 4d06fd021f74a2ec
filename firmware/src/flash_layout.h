// How an image lies in flash, the application's and that of an update in staging: README.md, Flash.
#ifndef FLASH_LAYOUT_H
#define FLASH_LAYOUT_H

#define APPLICATION 0x1000
#define STAGING 0x8000
#define IMAGE_PAGES 56

// The description, in the last bytes of an image's last page; all offsets are from the image's begin.
#define DESCRIPTION 0x6FE0
#define DESCRIPTION_HARDWARE (DESCRIPTION + 2)
#define DESCRIPTION_VERSION (DESCRIPTION + 3)
#define DESCRIPTION_LENGTH (DESCRIPTION + 6)
#define DESCRIPTION_IMAGE_CRC (DESCRIPTION + 8)
#define DESCRIPTION_CRC (DESCRIPTION + 12)
#define DESCRIPTION_ATTEMPTS (DESCRIPTION + 16)
#define DESCRIPTION_CONFIRMED (DESCRIPTION + 17)

#define IMAGE_MAGIC 0x4E49
#define IMAGE_HARDWARE 1 // the board of README.md, Pins and wiring

#endif
