// Delivery of sweeps, with waits of 0.5, 1, 2 and then every 4 s for the acknowledgement. Each frame of the host begins
// them anew: where one is to be heard and the acknowledgement is not, the line is bad and not dead.
#include "delivery.h"

#include "../hal/round.h"
#include "cobs.h"
#include "counters.h"
#include "memory.h"
#include "record.h"
#include "ring.h"

#define FIRST_WAIT ROUNDS(500)
#define LONGEST_WAIT ROUNDS(4000)

static __xdata uint16_t wait; // rounds between the oldest sweep's last two times, 0 before the second
static uint16_t until_due; // rounds until it should go out
static bool is_ready; // it is due and sound, and stays ready until it has gone out
static const __xdata uint8_t *__xdata sent; // the sweep that went out last, if it is not acknowledged
static __xdata bool is_going_out;

// An acknowledgement that came while the sweep was going out again.
static __xdata bool acknowledged;
static __xdata uint16_t acknowledged_boot;
static __xdata uint32_t acknowledged_sequence;

void delivery_task(void)
{
    if (until_due != 0)
        until_due--;
    // In years, memory may change by itself. No host could ever acknowledge such a sweep, and it would keep back all that
    // follow: so it is not sent.
    if (until_due == 0 && !is_ready)
        is_ready = ring_seek();
}

bool delivery_is_due(void)
{
    return is_ready;
}

void delivery_begin(void)
{
    is_going_out = true;
    if (ring_oldest() == sent)
        counters.sweeps_resent++;
    else
        wait = 0;
    sent = ring_oldest();
    cobs_encode_begin(sent, ring_oldest_length(), ring_memory(), ring_memory_end());
}

void delivery_end(void)
{
    is_going_out = false;
    is_ready = false;
    if (wait == 0)
        wait = FIRST_WAIT;
    else if (wait != LONGEST_WAIT)
        wait *= 2;
    until_due = wait;
    if (acknowledged) {
        acknowledged = false;
        delivery_acknowledge(acknowledged_boot, acknowledged_sequence);
    }
}

void delivery_acknowledge(uint16_t boot, uint32_t sequence)
{
    if (is_going_out) {
        // The encoder still reads the slot, and a new sweep could overwrite it.
        acknowledged = true;
        acknowledged_boot = boot;
        acknowledged_sequence = sequence;
    } else if (record_acknowledge(boot, sequence)) {
        delivery_hasten();
        is_ready = false;
        sent = 0;
    }
}

void delivery_host_is_heard(void)
{
    wait = 0;
    if (until_due > FIRST_WAIT)
        until_due = FIRST_WAIT;
}

void delivery_hasten(void)
{
    wait = 0;
    until_due = 0;
}
