// A scanner unit: starts the chip, then goes round its tasks every 2 ms and sleeps in between.
#include <stdint.h>

#include "../hal/clock.h"
#include "../hal/cpu.h"
#include "../hal/pins.h"
#include "../hal/reset.h"
#include "../hal/round.h"
#include "../hal/stack.h"
#include "../hal/stepper.h"
#include "../hal/timebase.h"
#include "../hal/uart.h"
#include "../hal/watchdog.h"
#include "answer.h"
#include "boot_number.h"
#include "confirmation.h"
#include "core/cobs.h"
#include "core/gesture.h"
#include "core/protocol.h"
#include "core/turns.h"
#include "counters.h"
#include "delivery.h"
#include "echo.h"
#include "life.h"
#include "motor.h"
#include "receive.h"
#include "record.h"
#include "settings.h"
#include "surveyor.h"
#include "thermometer.h"
#include "transmit.h"
#include "unit.h"

#define UNHURRIED_MS 10
#if UNHURRIED_MS != GESTURE_SAMPLE_MS || UNHURRIED_MS != THERMOMETER_TASK_MS || UNHURRIED_MS != CONFIRMATION_TASK_MS
#error "a task counts on another interval"
#endif

__xdata struct counters counters;

static void start(void)
{
    stack_start();
    pins_start();
    reset_start();

    uint16_t boot = boot_number_count(); // flash is written before the clock is fast, which draws more of a new supply
    life_start();
    clock_start();
    answer_start(boot);
    record_start(boot);

    timebase_start();
    round_start();
    stepper_start();
    uart_start();
    receive_start();
    thermometer_start();
    unit_start_up();
    settings_start();
    surveyor_start();
    watchdog_start();
    cpu_allow_interrupts();
    uart_send(COBS_DELIMITER); // ends the frame that the reset may have cut off
    transmit_hello(REQUEST_NONE, PROTOCOL_VERSION);
}

// What need not be looked at in every round.
static void do_unhurried(void)
{
    static uint8_t until_due = 1; // rounds
    if (--until_due != 0)
        return;
    until_due = ROUNDS(UNHURRIED_MS);
    if (!stack_is_sound())
        reset_now(NOTE_STACK);
    if (turns_are_set())
        turns_task(timebase_now());
    surveyor_task();
    thermometer_task();
    confirmation_task();
}

void main(void)
{
    start();
    for (;;) {
        watchdog_feed();
        receive_task();
        unit_task();
        echo_task();
        motor_task();
        delivery_task();
        do_unhurried();
        transmit_task();
        round_wait();
    }
}
