// Time: PCA0 at SYSCLK/12, its wraps counted, its module 0 capturing both edges on CEX0 (datasheet chapter
// "Programmable Counter Array").
#include "timebase.h"

#include "timebase_stamp.h"

volatile uint16_t timebase_wraps;
static volatile uint16_t epochs; // wraps of the 32-bit count
static volatile uint8_t edges;
static volatile __idata union {
    uint32_t tick;
    struct {
        uint8_t low, high; // as captured
        uint16_t wraps;
    } parts;
} edge_ticks[2];

// Silicon may lose a flag of PCA0CN that goes up within an instruction that changes the register, a bit of it or all.
// The counter and the capture show that it did, and the flag is put up again.
#define READ_HIGH(high)                                                                                                \
    do {                                                                                                               \
        uint8_t low = PCA0L; /* latches the high byte */                                                               \
        (void)low;                                                                                                     \
        (high) = PCA0H;                                                                                                \
    } while (0)

void timebase_start(void)
{
    PCA0MD = PCA0MD_SYSCLK_12 | PCA0MD_ECF; // and goes on counting in idle mode
    PCA0CPM0 = PCA0CPM_CAPP | PCA0CPM_CAPN | PCA0CPM_ECCF;
    EIE1 |= EIE1_EPCA0;
    CR = 1;
}

uint32_t timebase_now(void)
{
    uint32_t now;
    __critical
    {
        uint8_t low = PCA0L; // latches the high byte
        uint8_t high = PCA0H;
        now = TIMEBASE_EXTEND(low, high);
    }
    return now;
}

// In the first half of the 16-bit count, whose last wrap is served: one wrap more shows in CF, and a second is 24 ms
// off.
void timebase_await_early(void)
{
    while (CF || (uint8_t)(timebase_now() >> 8) >= 0x80)
        ;
}

uint16_t timebase_high(uint32_t tick)
{
    uint16_t high;
    uint32_t now;
    __critical
    {
        now = timebase_now();
        high = epochs;
        // `now` knows of a wrap that still waits to be served.
        if (timebase_wraps == 0xFFFF && now < 0x80000000UL)
            high++;
    }
    bool is_ahead = (int32_t)(tick - now) >= 0;
    if (is_ahead && tick < now)
        return high + 1;
    return !is_ahead && tick > now ? high - 1 : high;
}

void timebase_watch_edges(void)
{
    __critical
    {
        uint8_t before, after;
        READ_HIGH(before);
        CCF0 = 0;
        READ_HIGH(after);
        if (after < before)
            CF = 1;
        edges = 0;
    }
}

uint8_t timebase_edges(void)
{
    return edges;
}

uint32_t timebase_edge(uint8_t edge)
{
    return edge_ticks[edge].tick; // the service routine has done with it
}

void timebase_isr(void) __interrupt(IRQ_PCA0)
{
    uint8_t before, low = PCA0CPL0, high = PCA0CPH0; // as captured
    READ_HIGH(before);
    if (CCF0) {
        CCF0 = 0;
        low = PCA0CPL0;
        high = PCA0CPH0;
        if (edges < 2) {
            edge_ticks[edges].parts.low = low;
            edge_ticks[edges].parts.high = high;
            edge_ticks[edges].parts.wraps = timebase_wraps + (CF && high < 0x80);
            edges++;
        }
    }
    if (CF) {
        CF = 0;
        if (++timebase_wraps == 0)
            epochs++;
    } else {
        uint8_t after;
        READ_HIGH(after);
        if (after < before)
            CF = 1;
    }
    if (PCA0CPL0 != low || PCA0CPH0 != high)
        CCF0 = 1;
}
