// Turns to speak. Ticks are the count's low 32 bits: only their differences mean something.
#include "turns.h"

#include "memory.h"

static __xdata uint32_t period; // 0: no turns
static __xdata uint32_t turn;

bool turns_set(uint32_t start, uint32_t wanted, uint32_t now)
{
    if (wanted < TURNS_SHORTEST_TICKS || wanted > TURNS_LONGEST_TICKS)
        return false;
    period = wanted;
    turn = start;
    if ((int32_t)(start - now) > 0)
        turn -= (start - now) / period * period;
    else
        turn += (now - start) / period * period;
    turns_task(now);
    return true;
}

void turns_clear(void)
{
    period = 0;
}

bool turns_are_set(void)
{
    return period != 0;
}

bool turns_may_ping(uint32_t now)
{
    return period == 0 || now - turn < TURNS_OPEN_TICKS;
}

void turns_task(uint32_t now)
{
    if (period != 0 && (int32_t)(now - turn) >= TURNS_OPEN_TICKS)
        turn += period;
}
