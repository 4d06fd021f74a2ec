// The 28BYJ-48: timer 3 at SYSCLK/12 paces the half steps (datasheet chapter "Timers"), port 2 drives the ULN2003.
#include "stepper.h"

#include "board.h"

#define QUEUE_SIZE 8 // a power of two; 7 ms of the fastest half steps, for the main loop to be late
#define LONGEST_RUN_US 16383 // of the timer
#define CLOCKS_PER_US 4

// Half steps of a rising bearing: IN1, IN1+IN2, IN2, IN2+IN3, IN3, IN3+IN4, IN4, IN4+IN1.
static const __code uint8_t coils[STEPPER_PHASES] = {0x1, 0x3, 0x2, 0x6, 0x4, 0xC, 0x8, 0x9};

// A run of the timer, and how things stand when it ends.
struct run {
    uint16_t start; // where the timer begins to count
    int16_t position;
    uint8_t coils;
};

static __idata struct run runs[QUEUE_SIZE];
static __idata struct run *next = runs; // to be queued
static __idata struct run *volatile running = runs;
static volatile uint8_t queued; // runs, modulo 256
static volatile uint8_t made;
static volatile __bit turning;
static volatile __bit watching_home;
static __bit falling; // towards lower bearings
static uint8_t last_phase; // after the last run queued, as the next one
static int16_t last_position;
static volatile int16_t position;
static volatile int16_t home_position;

// A macro, because the main program and the service routine both need it.
#define RUN_TIMER()                                                                                                    \
    do {                                                                                                               \
        TMR3 = running->start;                                                                                         \
        TMR3CN = TMR3CN_TR3;                                                                                           \
    } while (0)

void stepper_start(void)
{
    EIE1 |= EIE1_ET3;
}

void stepper_set_direction(bool decreasing)
{
    falling = decreasing;
}

bool stepper_has_room(void)
{
    return (uint8_t)(queued - made) < QUEUE_SIZE - 1; // a half step may need two runs
}

static void push_run(uint16_t run_us)
{
    next->start = -(run_us * CLOCKS_PER_US);
    next->position = last_position;
    next->coils = COILS_OFF | coils[last_phase % STEPPER_PHASES];
    if (++next == runs + QUEUE_SIZE)
        next = runs;
    queued++;
}

void stepper_push(uint16_t interval_us)
{
    if (!turning)
        PORT_COILS = COILS_OFF | coils[last_phase % STEPPER_PHASES]; // holds the motor for the first interval
    if (interval_us > LONGEST_RUN_US) {
        interval_us /= 2;
        push_run(interval_us); // the motor stands still until the next
    }
    if (falling) {
        last_position--;
        last_phase--;
    } else {
        last_position++;
        last_phase++;
    }
    push_run(interval_us);
    if (!turning) {
        turning = 1;
        RUN_TIMER();
    }
}

bool stepper_is_turning(void)
{
    return turning;
}

void stepper_release(void)
{
    PORT_COILS = COILS_OFF;
}

int16_t stepper_position(void)
{
    int16_t now;
    __critical
    {
        now = position;
    }
    return now;
}

void stepper_set_position(int16_t half_steps)
{
    position = half_steps;
    last_position = half_steps;
}

uint8_t stepper_phase(void)
{
    return last_phase % STEPPER_PHASES;
}

void stepper_watch_home(void)
{
    watching_home = 1;
}

bool stepper_saw_home(void)
{
    return !watching_home;
}

int16_t stepper_home_position(void)
{
    return home_position;
}

void stepper_isr(void) __interrupt(IRQ_TIMER3)
{
    TMR3CN = 0;
    if (watching_home && !PIN_HOME) {
        home_position = position;
        watching_home = 0;
    }
    position = running->position;
    PORT_COILS = running->coils;
    if (++running == runs + QUEUE_SIZE)
        running = runs;
    if (++made == queued)
        turning = 0;
    else
        RUN_TIMER();
}
