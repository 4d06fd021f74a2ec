// Consistent overhead byte stuffing. A block is a code byte n and n - 1 bytes that are not zero; it stands for these
// and a zero, but for the longest block (n = 255) and the frame's last, which have no zero.
#include "cobs.h"

#define LONGEST_RUN 254

static __xdata struct {
    const __xdata uint8_t *at;
    const __xdata uint8_t *memory;
    const __xdata uint8_t *memory_end;
    uint16_t left; // bytes of the frame not yet sent
    uint8_t run; // bytes to send before the next code
    bool zero_next; // the run ends in a zero of the frame's, which the next code stands for
    bool last; // no code follows the run
} encoder;

static __xdata struct {
    uint8_t run; // bytes to come before the next code
    bool zero_due; // the next code stands for a zero too
} decoder;

static uint8_t take(void)
{
    uint8_t byte = *encoder.at++;
    if (encoder.at == encoder.memory_end)
        encoder.at = encoder.memory;
    encoder.left--;
    return byte;
}

// How many bytes come before the next zero, the frame's end, or the end of the longest block.
static uint8_t run_ahead(void)
{
    const __xdata uint8_t *at = encoder.at;
    uint8_t longest = encoder.left < LONGEST_RUN ? (uint8_t)encoder.left : LONGEST_RUN;
    uint8_t run = 0;
    while (run < longest && *at != 0) {
        run++;
        if (++at == encoder.memory_end)
            at = encoder.memory;
    }
    return run;
}

void cobs_encode_begin(const __xdata uint8_t *frame, uint16_t length, const __xdata uint8_t *memory,
                       const __xdata uint8_t *memory_end)
{
    encoder.at = frame;
    encoder.memory = memory;
    encoder.memory_end = memory_end;
    encoder.left = length;
    encoder.run = 0;
    encoder.zero_next = false;
    encoder.last = false;
}

uint8_t cobs_encode(void)
{
    if (encoder.run != 0) {
        encoder.run--;
        return take();
    }
    if (encoder.last)
        return COBS_DELIMITER;
    if (encoder.zero_next)
        take();
    encoder.run = run_ahead();
    encoder.last = encoder.run == encoder.left;
    encoder.zero_next = encoder.run < LONGEST_RUN && !encoder.last;
    return encoder.run + 1;
}

void cobs_decode_begin(void)
{
    decoder.run = 0;
    decoder.zero_due = false;
}

int16_t cobs_decode(uint8_t byte)
{
    bool zero = decoder.zero_due;
    if (decoder.run != 0) {
        decoder.run--;
        return byte;
    }
    decoder.run = byte - 1;
    decoder.zero_due = byte <= LONGEST_RUN;
    return zero ? 0 : COBS_NOTHING;
}

bool cobs_decode_is_complete(void)
{
    return decoder.run == 0;
}
