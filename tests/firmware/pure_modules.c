// Runs the firmware's pure modules for the tests: reads one command a line, writes one line of answer.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "backlash.h"
#include "bearing.h"
#include "calibration.h"
#include "check.h"
#include "cobs.h"
#include "crc.h"
#include "gesture.h"
#include "incoming.h"
#include "median.h"
#include "plan.h"
#include "protocol.h"
#include "pure_modules.h"
#include "ramp.h"
#include "request.h"
#include "turns.h"
#include "wire_layout.h"

uint8_t bytes[MOST_BYTES];
static char line[2 * MOST_BYTES + 64];

size_t parse_hex(const char *hex)
{
    size_t length = 0;
    unsigned byte;
    for (; sscanf(hex, "%2x", &byte) == 1; hex += 2)
        bytes[length++] = (uint8_t)byte;
    return length;
}

void answer_encoded(const uint8_t *frame, size_t length, const uint8_t *memory, const uint8_t *memory_end)
{
    uint8_t byte;
    cobs_encode_begin(frame, (uint16_t)length, memory, memory_end);
    do {
        byte = cobs_encode();
        printf("%02x", byte);
    } while (byte != COBS_DELIMITER);
    puts("");
}

static void encode(const char *hex)
{
    size_t length = parse_hex(hex);
    answer_encoded(bytes, length, bytes, bytes + MOST_BYTES);
}

// Encodes a frame that lies in a circular memory of its own length, from `start` to its end and on at its beginning.
static void encode_wrapped(const char *arguments)
{
    size_t start = strtoul(arguments, NULL, 10);
    size_t length = parse_hex(strchr(arguments, ' ') + 1);
    uint8_t *memory = malloc(length);
    for (size_t i = 0; i < length; i++)
        memory[(start + i) % length] = bytes[i];
    answer_encoded(memory + start, length, memory, memory + length);
    free(memory);
}

static void decode(const char *hex)
{
    size_t length = parse_hex(hex);
    cobs_decode_begin();
    printf("=");
    for (size_t i = 0; i < length; i++) {
        int16_t byte = cobs_decode(bytes[i]);
        if (byte != COBS_NOTHING)
            printf("%02x", (unsigned)byte);
    }
    puts(cobs_decode_is_complete() ? " complete" : " incomplete");
}

// Why the frame that has come in is rejected, as receive.c and command.c find it.
static uint8_t reason_to_reject(void)
{
    uint8_t reason = incoming_end();
    if (reason != REASON_NONE)
        return reason;
    if (request_length(incoming.frame[0]) == REQUEST_UNKNOWN)
        return REASON_UNKNOWN_TYPE;
    return request_has_length(incoming.frame[0], incoming.length) ? REASON_NONE : REASON_WRONG_LENGTH;
}

static void answer_frame(void)
{
    uint8_t reason = reason_to_reject();
    if (reason != REASON_NONE)
        printf("%u", reason);
    else
        for (uint8_t i = 0; i < incoming.length; i++)
            printf("%02x", incoming.frame[i]);
}

// For each frame that ends in the stream: its content, or the reason for which it is rejected.
static void receive(const char *hex)
{
    size_t length = parse_hex(hex);
    incoming_begin();
    for (size_t i = 0; i < length; i++) {
        if (bytes[i] != COBS_DELIMITER) {
            incoming_take(bytes[i]);
            continue;
        }
        if (incoming_is_empty())
            printf("nothing");
        else
            answer_frame();
        printf(" ");
        incoming_begin();
    }
    puts(".");
}

static void plan_layout(const char *hex)
{
    struct plan plan;
    parse_hex(hex);
    layout_read_plan(&plan, bytes);
    printf("%d %u %u %u %u %u %u %u ", plan.first_bearing, plan.bearing_step, plan.count, plan.ping_interval_ms,
           plan.top_speed, plan.ramp_ms, plan.settle_ms, plan.pings);
    layout_write_plan(bytes, &plan);
    for (size_t i = 0; i < LAYOUT_PLAN_BYTES; i++)
        printf("%02x", bytes[i]);
    puts("");
}

static void calibration_layout(const char *hex)
{
    struct calibration calibration;
    parse_hex(hex);
    layout_read_calibration(&calibration, bytes);
    printf("%lu %u %u %d ", (unsigned long)calibration.half_steps_per_turn, calibration.backlash, calibration.home,
           calibration.home_bearing);
    layout_write_calibration(bytes, &calibration);
    for (size_t i = 0; i < LAYOUT_CALIBRATION_BYTES; i++)
        printf("%02x", bytes[i]);
    puts("");
}

static void crc(const char *hex)
{
    size_t length = parse_hex(hex);
    uint32_t value = CRC_EMPTY;
    for (size_t i = 0; i < length; i++)
        value = crc_add(value, bytes[i]);
    printf("%lu\n", (unsigned long)crc_end(value));
}

static void ramp(const char *arguments)
{
    unsigned top_speed, ramp_ms, levels;
    sscanf(arguments, "%u %u %u", &top_speed, &ramp_ms, &levels);
    ramp_set((uint16_t)top_speed, (uint16_t)ramp_ms);
    for (unsigned level = 1; level <= levels; level++)
        printf("%u ", ramp_interval_us((uint16_t)level));
    printf("%u\n", ramp_cruise_us());
}

// The half steps of a turn in 1/256, and what to turn into the other.
static void half_step(const char *arguments)
{
    unsigned long turn;
    int bearing;
    sscanf(arguments, "%lu %d", &turn, &bearing);
    bearing_set_turn((uint32_t)turn);
    printf("%d\n", bearing_to_half_step((int16_t)bearing));
}

static void bearing(const char *arguments)
{
    unsigned long turn;
    int position;
    sscanf(arguments, "%lu %d", &turn, &position);
    bearing_set_turn((uint32_t)turn);
    printf("%d\n", bearing_of_half_step((int16_t)position));
}

// The play, where the motor is after a fall, and the half steps that the sensor shall look at one after the other;
// answers where the motor goes for each.
static void backlash(const char *arguments)
{
    char *rest;
    backlash_set((uint8_t)strtol(arguments, &rest, 10));
    int16_t motor = backlash_motor_after_fall((int16_t)strtol(rest, &rest, 10));
    while (*rest != '\0') {
        motor = backlash_motor(motor, (int16_t)strtol(rest, &rest, 10));
        printf("%d ", motor);
    }
    printf("%d\n", backlash_sensor(motor));
}

// The kind of home, where the sensor looks, and what happens: s a sweep, a number the slip that a check finds, u a home
// found for the first time; d asks whether a check is due, f for the next sweep's flags.
static void check(const char *arguments)
{
    struct calibration calibration = calibration_default;
    int home, half_step, read;
    sscanf(arguments, "%d %d%n", &home, &half_step, &read);
    calibration.home = (uint8_t)home;
    for (const char *rest = arguments + read; *rest != '\0'; rest++)
        if (*rest == 's')
            check_count_sweep();
        else if (*rest == 'd')
            printf("%d ", check_is_due(&calibration, (int16_t)half_step));
        else if (*rest == 'f')
            printf("%d ", check_sweep_flags());
        else if (*rest == 'u')
            check_end(SLIP_UNKNOWN);
        else if (*rest == '-' || (*rest >= '0' && *rest <= '9'))
            check_end((int16_t)strtol(rest, (char **)&rest, 10)), rest--;
    puts(".");
}

// A turn's tick, the period, now, and for how many ticks turns_task() is called at which interval: when one may ping,
// the first tick of each time, all from `now`.
static void turns(const char *arguments)
{
    unsigned long start, period, now, ticks, step;
    sscanf(arguments, "%lu %lu %lu %lu %lu", &start, &period, &now, &ticks, &step);
    if (!turns_set((uint32_t)start, (uint32_t)period, (uint32_t)now)) {
        puts("refused");
        return;
    }
    bool could = false;
    for (unsigned long since = 0; since < ticks; since += step) {
        bool can = turns_may_ping((uint32_t)(now + since));
        if (can && !could)
            printf("%lu ", since);
        could = can;
        turns_task((uint32_t)(now + since));
    }
    turns_clear();
    printf("%d %d\n", turns_are_set(), turns_may_ping((uint32_t)now));
}

static void median(const char *arguments)
{
    char *rest = (char *)arguments;
    median_begin();
    while (*rest != '\0')
        median_add((uint32_t)strtoul(rest, &rest, 10));
    printf("%lu\n", (unsigned long)median_value());
}

static void is_possible_calibration(const char *arguments)
{
    unsigned long turn;
    unsigned play, home;
    int home_bearing;
    sscanf(arguments, "%lu %u %u %d", &turn, &play, &home, &home_bearing);
    struct calibration calibration = {(uint32_t)turn, (uint8_t)play, (uint8_t)home, (int16_t)home_bearing};
    printf("%d\n", calibration_is_possible(&calibration));
}

static void is_possible(const char *arguments)
{
    int first;
    unsigned step, count, interval, speed, ramp_ms, settle, pings;
    sscanf(arguments, "%d %u %u %u %u %u %u %u", &first, &step, &count, &interval, &speed, &ramp_ms, &settle, &pings);
    struct plan plan = {(int16_t)first,  (uint16_t)step,    (uint8_t)count,  (uint16_t)interval,
                        (uint16_t)speed, (uint16_t)ramp_ms, (uint16_t)settle, (uint8_t)pings};
    printf("%d\n", plan_is_possible(&plan));
}

// The millisecond of the first sample, and the contact's level at every millisecond, 1 closed; answers the milliseconds
// at which gestures are over.
static void gestures(const char *arguments)
{
    size_t first_ms = strtoul(arguments, NULL, 10);
    const char *levels = strchr(arguments, ' ') + 1;
    size_t end_ms = strlen(levels);
    for (size_t ms = first_ms; ms < end_ms; ms += GESTURE_SAMPLE_MS) {
        enum gesture gesture = gesture_sample(levels[ms] == '1');
        if (gesture != GESTURE_NONE)
            printf("%s@%zu ", gesture == GESTURE_PRESS ? "press" : "double", ms);
    }
    puts(".");
}

static void answer(const char *command, const char *arguments)
{
    if (strcmp(command, "crc") == 0)
        crc(arguments);
    else if (strcmp(command, "encode") == 0)
        encode(arguments);
    else if (strcmp(command, "encode_wrapped") == 0)
        encode_wrapped(arguments);
    else if (strcmp(command, "decode") == 0)
        decode(arguments);
    else if (strcmp(command, "receive") == 0)
        receive(arguments);
    else if (strcmp(command, "plan_layout") == 0)
        plan_layout(arguments);
    else if (strcmp(command, "calibration_layout") == 0)
        calibration_layout(arguments);
    else if (strcmp(command, "half_step") == 0)
        half_step(arguments);
    else if (strcmp(command, "bearing") == 0)
        bearing(arguments);
    else if (strcmp(command, "ramp") == 0)
        ramp(arguments);
    else if (strcmp(command, "plan") == 0)
        is_possible(arguments);
    else if (strcmp(command, "backlash") == 0)
        backlash(arguments);
    else if (strcmp(command, "calibration") == 0)
        is_possible_calibration(arguments);
    else if (strcmp(command, "check") == 0)
        check(arguments);
    else if (strcmp(command, "median") == 0)
        median(arguments);
    else if (strcmp(command, "turns") == 0)
        turns(arguments);
    else if (strcmp(command, "gestures") == 0)
        gestures(arguments);
    else if (!answer_of_ring(command, arguments))
        exit(2);
}

int main(void)
{
    while (fgets(line, sizeof line, stdin) != NULL) {
        line[strcspn(line, "\n")] = '\0';
        char *space = strchr(line, ' ');
        if (space != NULL)
            *space = '\0';
        answer(line, space != NULL ? space + 1 : "");
        fflush(stdout);
    }
    return 0;
}
