// Delivery of sweeps, with waits of 0.5, 1, 2 and then every 4 s for the acknowledgement. Each frame of the host begins
// them again: where one is to be heard and the acknowledgement is not, the line is bad and not dead.
#include "delivery.h"

#include "../hal/round.h"
#include "core/cobs.h"
#include "core/memory.h"
#include "core/ring.h"
#include "counters.h"
#include "record.h"

#define FIRST_WAIT ROUNDS(500)
#define LONGEST_WAIT ROUNDS(4000)

static __xdata uint16_t wait; // rounds between the oldest sweep's last two times, 0 before the second
static uint16_t until_due; // rounds until it should go out
static __bit is_ready; // it is due and sound, and stays ready until it has gone out
static const __xdata uint8_t *__xdata sent; // the sweep that went out last, if it is not acknowledged
static __xdata bool is_going_out;

// An acknowledgement that came while the sweep was going out again.
static __xdata uint8_t acknowledged_bytes; // of its name; 0: none came
static __xdata uint8_t acknowledged_name[RECORD_NAME_BYTES];

void delivery_task(void)
{
    if (until_due != 0 && --until_due != 0)
        return;
    if (is_ready)
        return;
    // In years, memory may change by itself; and a chip may have been flashed with another serial number. No host could
    // ever acknowledge such a sweep, and it would keep back all that follow: so it is not sent.
    if (!ring_seek())
        return;
    if (record_is_own())
        is_ready = true;
    else
        ring_drop_oldest();
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
    if (acknowledged_bytes != 0) {
        delivery_acknowledge(acknowledged_name, acknowledged_bytes);
        acknowledged_bytes = 0;
    }
}

void delivery_acknowledge(const __xdata uint8_t *name, uint8_t bytes)
{
    if (is_going_out) {
        // The encoder still reads the slot, and a new sweep could overwrite it.
        for (uint8_t i = 0; i < bytes; i++)
            acknowledged_name[i] = name[i];
        acknowledged_bytes = bytes;
    } else if (record_acknowledge(name, bytes)) {
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
