// Frames over UART0 (datasheet chapter of that name), timer 1 giving the baud rate. COBS as in ../src/cobs.h, but of
// frames that lie in memory whole, and so short on the way out that none needs the longest block.
#include "line.h"

#include "../hal/chip.h"
#include "../src/core/protocol.h"
#include "checksum.h"

#define TIMER_RELOAD 0xCC // 12 MHz / 52 / 2 = 115,385 baud, 0.16 % fast
#define SHORTEST_FRAME (1 + CHECKSUM_BYTES)
#define LONGEST_FRAME (4 + PUT_BYTES + CHECKSUM_BYTES)
#define LONGEST_RUN 254

__xdata uint8_t line_frame[LONGEST_FRAME];
uint8_t line_length;
static uint8_t run; // bytes to come before the next code
static bool zero_due; // the next code stands for a zero too
static bool is_empty;
static bool is_too_long;
static bool has_ended;

static void begin_frame(void)
{
    checksum_begin();
    line_length = 0;
    run = 0;
    zero_due = false;
    is_empty = true;
    is_too_long = false;
    has_ended = false;
}

void line_start(void)
{
    CKCON |= CKCON_T1M;
    TMOD = TMOD_T1_AUTO_RELOAD;
    TH1 = TIMER_RELOAD;
    TL1 = TIMER_RELOAD;
    TR1 = 1;
    SCON0 = SCON0_REN0;
    begin_frame();
}

static void store(uint8_t byte)
{
    if (line_length == LONGEST_FRAME)
        is_too_long = true;
    else
        line_put8(byte);
}

static void decode(uint8_t encoded)
{
    is_empty = false;
    if (run != 0) {
        run--;
        store(encoded);
        return;
    }
    if (zero_due)
        store(0);
    run = encoded - 1;
    zero_due = encoded <= LONGEST_RUN;
}

static uint8_t judge(void)
{
    if (is_empty)
        return REASON_NONE;
    if (is_too_long)
        return REASON_TOO_LONG;
    if (run != 0 || line_length < SHORTEST_FRAME || checksum() != CHECKSUM_OF_SOUND)
        return REASON_UNREADABLE;
    line_length -= CHECKSUM_BYTES;
    return LINE_FRAME;
}

uint8_t line_receive(void)
{
    if (!RI0)
        return REASON_NONE;
    uint8_t byte = SBUF0;
    RI0 = 0;
    if (has_ended)
        begin_frame();
    if (byte != 0) {
        decode(byte);
        return REASON_NONE;
    }
    has_ended = true;
    return judge();
}

void line_begin(uint8_t type)
{
    begin_frame();
    line_put8(type);
}

void line_put8(uint8_t value)
{
    line_frame[line_length++] = value;
    checksum_add(value);
}

void line_put32(uint32_t value)
{
    for (uint8_t i = 0; i < 4; i++) {
        line_put8((uint8_t)value);
        value >>= 8;
    }
}

static void send_byte(uint8_t byte)
{
    SBUF0 = byte;
    while (!TI0)
        ;
    TI0 = 0;
}

// Sends the bytes up to the next zero or the frame's end, their code first; gives where that is.
static uint8_t send_block(uint8_t begin)
{
    uint8_t end = begin;
    while (end < line_length && line_frame[end] != 0)
        end++;
    send_byte(end - begin + 1);
    for (uint8_t i = begin; i < end; i++)
        send_byte(line_frame[i]);
    return end;
}

void line_send(void)
{
    uint8_t end;
    line_put32(checksum());
    end = send_block(0);
    while (end < line_length)
        end = send_block(end + 1);
    send_byte(0);
    begin_frame();
}
