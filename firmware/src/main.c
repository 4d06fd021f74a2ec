// A scanner unit: starts the chip, then goes round its tasks every 2 ms and sleeps in between.
#include <stdint.h>

#include "../hal/clock.h"
#include "../hal/cpu.h"
#include "../hal/pins.h"
#include "../hal/reset.h"
#include "../hal/round.h"
#include "../hal/stepper.h"
#include "../hal/timebase.h"
#include "../hal/uart.h"
#include "../hal/watchdog.h"
#include "answer.h"
#include "boot_number.h"
#include "counters.h"
#include "delivery.h"
#include "echo.h"
#include "motor.h"
#include "protocol.h"
#include "receive.h"
#include "record.h"
#include "surveyor.h"
#include "unit.h"
#include "transmit.h"

__xdata struct counters counters;

static void start(void)
{
    pins_start();
    clock_start();
    reset_start();

    // Flash first: while it is written nothing else may run.
    uint16_t boot = boot_number_count();
    answer_start(boot);
    record_start(boot, reset_was_power_up());

    timebase_start();
    round_start();
    stepper_start();
    uart_start();
    receive_start();
    unit_start_up();
    watchdog_start();
    cpu_allow_interrupts();
    transmit_hello(REQUEST_NONE);
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
        surveyor_task();
        delivery_task();
        transmit_task();
        round_wait();
    }
}
