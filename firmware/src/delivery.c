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
static __xdata bool was_sent;
static __xdata bool is_going_out;

// An acknowledgement that came while the sweep was going out again.
static __xdata bool acknowledged;
static __xdata uint16_t acknowledged_boot;
static __xdata uint32_t acknowledged_sequence;

void delivery_task(void)
{
    if (until_due == 0 || --until_due != 0)
        return;
    if (was_sent && !ring_oldest_is_sound()) {
        // No host can ever acknowledge it, and it would keep back all that follow.
        ring_sift();
        was_sent = false;
        wait = 0;
    }
}

bool delivery_is_due(void)
{
    return until_due == 0 && ring_frames() != 0;
}

void delivery_begin(void)
{
    is_going_out = true;
    if (was_sent)
        counters.sweeps_resent++;
    cobs_encode_begin(ring_oldest(), ring_oldest_length(), ring_memory(), ring_memory_end());
}

void delivery_end(void)
{
    is_going_out = false;
    was_sent = true;
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
        was_sent = false;
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
