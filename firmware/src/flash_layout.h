// What loader and application both find in flash, by the tables in README.md, Flash: images (the application, and that
// of an update in staging) and the settings pages.
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
#define IMAGE_HARDWARE 1 // the board of hardware/wiring.md

#define SETTINGS_FIRST_PAGE 0xF600
#define SETTINGS_SECOND_PAGE 0xF800
#define SETTINGS_MAGIC 0x4E43

// From a settings page's begin.
#define SETTINGS_VERSION 2
#define SETTINGS_LENGTH 3 // of what follows, but for the CRC
#define SETTINGS_GENERATION 4
#define SETTINGS_SERIAL 6

#endif
