// The 28BYJ-48: timer 3 at SYSCLK/12, with automatic reload, paces the half steps (datasheet chapter "Timers"), port 2
// drives the ULN2003.
#include "stepper.h"

#include "board.h"

#define ROOM_BELOW 8 // half steps queued; at the fastest that is 8 ms for the main loop to be late
#define RUNS 16 // that many half steps at their slowest
#define CLOCKS_PER_US 4
#define HOME_SAMPLES 3 // a coil that switches may disturb one

// Half steps of a rising bearing: IN1, IN1+IN2, IN2, IN2+IN3, IN3, IN3+IN4, IN4, IN4+IN1.
// In internal memory, where the service routine finds them in half the time.
static const __idata uint8_t coils[STEPPER_PHASES] = {
    COILS_OFF | 0x1, COILS_OFF | 0x3, COILS_OFF | 0x2, COILS_OFF | 0x6,
    COILS_OFF | 0x4, COILS_OFF | 0xC, COILS_OFF | 0x8, COILS_OFF | 0x9,
};

// Half steps the same period of the timer apart; none: one period in which the motor stands still.
struct run {
    uint8_t reload_low; // of the timer, for one period
    uint8_t reload_high;
    uint8_t half_steps;
};

static __idata struct run runs[RUNS];
static __idata struct run *next = runs; // to be queued
static __idata struct run *volatile running = runs;
static volatile uint8_t queued; // half steps, modulo 256
static volatile uint8_t made;
static volatile uint8_t home_made; // at the first of the samples that found the switch at home
static uint8_t home_samples; // in a row, the service routine's alone
static volatile __bit turning;
static volatile __bit watching_home;
static __bit home_level; // of the switch's pin
static __bit falling; // towards lower bearings
static uint8_t phase; // the service routine's alone while it is turning, as is:
static uint8_t left; // half steps of the run
static int16_t last_position; // when all that is queued has been made

// A macro, because the main program and the service routine both need it.
#define BEGIN_RUN()                                                                                                    \
    do {                                                                                                               \
        TMR3RLL = running->reload_low;                                                                                 \
        TMR3RLH = running->reload_high;                                                                                \
        TMR3L = running->reload_low;                                                                                   \
        TMR3H = running->reload_high;                                                                                  \
        left = running->half_steps;                                                                                    \
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
    return (uint8_t)(queued - made) < ROOM_BELOW;
}

static inline void push_run(uint16_t period_us, uint8_t half_steps)
{
    uint16_t reload = -(period_us * CLOCKS_PER_US);
    __idata struct run *run = next; // the compiler would load `next` again for each field
    run->reload_low = (uint8_t)reload;
    run->reload_high = reload >> 8;
    run->half_steps = half_steps;
    if (++next == runs + RUNS)
        next = runs;
    queued += half_steps;
    if (falling)
        last_position -= half_steps;
    else
        last_position += half_steps;
}

void stepper_push(uint16_t interval_us, uint8_t half_steps)
{
    if (interval_us > STEPPER_LONGEST_TOGETHER_US) { // more than a period of the timer
        interval_us /= 2;
        push_run(interval_us, 0);
    }
    push_run(interval_us, half_steps);
    if (!turning) {
        PORT_COILS = coils[phase % STEPPER_PHASES]; // holds the motor for the first interval
        turning = 1;
        BEGIN_RUN();
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

static int16_t position_when(uint8_t half_steps_made)
{
    uint8_t to_come = queued - half_steps_made;
    return falling ? last_position + to_come : last_position - to_come;
}

int16_t stepper_position(void)
{
    return position_when(made);
}

void stepper_set_position(int16_t half_steps)
{
    last_position = half_steps;
}

uint8_t stepper_phase(void)
{
    return phase % STEPPER_PHASES;
}

void stepper_watch_home(bool opens)
{
    home_level = opens;
    home_samples = 0;
    watching_home = 1;
}

bool stepper_saw_home(void)
{
    return !watching_home;
}

int16_t stepper_home_position(void)
{
    return position_when(home_made);
}

void stepper_isr(void) __interrupt(IRQ_TIMER3)
{
    TMR3CN = TMR3CN_TR3; // the flag is down, and the next period has begun
    if (left != 0) {
        if (watching_home) {
            if (PIN_HOME != home_level) {
                home_samples = 0;
            } else {
                if (home_samples == 0)
                    home_made = made;
                if (++home_samples == HOME_SAMPLES)
                    watching_home = 0;
            }
        }
        if (falling)
            phase--;
        else
            phase++;
        PORT_COILS = coils[phase % STEPPER_PHASES];
        made++;
        if (--left != 0)
            return;
    }
    TMR3CN = 0;
    if (++running == runs + RUNS)
        running = runs;
    if (made == queued)
        turning = 0;
    else
        BEGIN_RUN();
}
