// The commands of pure_modules that are about the ring.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pure_modules.h"
#include "ring.h"

static void ring_add(const char *hex)
{
    size_t length = parse_hex(hex);
    if (!ring_has_room((uint16_t)length)) {
        puts("full");
        return;
    }
    ring_begin();
    for (size_t i = 0; i < length; i++)
        ring_put(bytes[i]);
    while (!ring_commit())
        ;
    puts("added");
}

static void ring_show(void)
{
    printf("%u %u ", ring_frames(), ring_used());
    for (uint16_t i = 0; ring_has_oldest() && i < ring_oldest_length(); i++)
        printf("%02x", ring_oldest_byte(i));
    puts("");
}

// Up to so many calls of ring_seek(); answers how that ended and after how many.
static void seek(const char *arguments)
{
    unsigned most = (unsigned)strtoul(arguments, NULL, 10);
    for (unsigned calls = 1; calls <= most; calls++) {
        if (ring_seek()) {
            printf("found %u\n", calls);
            return;
        }
        if (ring_used() == 0) {
            printf("empty %u\n", calls);
            return;
        }
    }
    puts("seeking");
}

// What radiation or a fading supply would do; the offset is from the beginning of the ring's memory.
static void ring_flip(const char *arguments)
{
    size_t offset, bits;
    sscanf(arguments, "%zu %zu", &offset, &bits);
    ((uint8_t *)ring_memory())[offset] ^= (uint8_t)bits;
    puts("flipped");
}

static void ring_send_oldest(void)
{
    answer_encoded(ring_oldest(), ring_oldest_length(), ring_memory(), ring_memory_end());
}

bool answer_of_ring(const char *command, const char *arguments)
{
    if (strcmp(command, "ring_clear") == 0)
        ring_clear(), puts("cleared");
    else if (strcmp(command, "ring_recover") == 0)
        ring_recover(), puts("recovered");
    else if (strcmp(command, "ring_add") == 0)
        ring_add(arguments);
    else if (strcmp(command, "ring_seek") == 0)
        seek(arguments);
    else if (strcmp(command, "ring_drop") == 0)
        ring_drop_oldest(), puts("dropped");
    else if (strcmp(command, "ring_flip") == 0)
        ring_flip(arguments);
    else if (strcmp(command, "ring_show") == 0)
        ring_show();
    else if (strcmp(command, "ring_send_oldest") == 0)
        ring_send_oldest();
    else
        return false;
    return true;
}
