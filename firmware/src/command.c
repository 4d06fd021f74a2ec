// The host's commands, by the table in ../README.md.
#include "command.h"

#include <stdbool.h>

#include "../hal/reset.h"
#include "../hal/timebase.h"
#include "core/calibration.h"
#include "core/little_endian.h"
#include "core/plan.h"
#include "core/protocol.h"
#include "core/request.h"
#include "core/turns.h"
#include "core/wire_layout.h"
#include "delivery.h"
#include "life.h"
#include "settings.h"
#include "thermometer.h"
#include "transmit.h"
#include "unit.h"
#include "update.h"

#define FOR_BYTES 9       // before the frame that is in a FOR
#define REPEATS_WITHIN 32 // requests; a host that counts them comes back to a number only after 255

// The last command that was run: it is known again by its CRC, and its number alone may have been used again.
static __xdata struct {
    uint8_t request; // 0: none
    uint8_t type;
    uint8_t result;
    uint8_t age; // requests since
    uint32_t crc;
} last;

static uint8_t configure(const __xdata uint8_t *payload)
{
    static __xdata struct plan wanted;
    layout_read_plan(&wanted, payload);
    return unit_configure(&wanted);
}

static uint8_t calibrate(const __xdata uint8_t *payload)
{
    static __xdata struct calibration wanted;
    layout_read_calibration(&wanted, payload);
    return unit_calibrate(&wanted);
}

// `pause_ms`, then, but in a short one, the tick of a turn and the period of turns, 0 for none.
static uint8_t start(const __xdata uint8_t *payload, uint8_t length)
{
    uint32_t period = length == REQUEST_FREE_START ? 0 : get32(payload + 8);
    if (period == 0)
        turns_clear();
    else if (get16(payload + 6) != timebase_high(get32(payload + 2)) ||
             !turns_set(get32(payload + 2), period, timebase_now()))
        return RESULT_OUT_OF_RANGE;
    return unit_start(get16(payload));
}

static uint8_t store(void)
{
    if (!unit_is_at_rest())
        return RESULT_BUSY;
    return settings_store() ? RESULT_DONE : RESULT_FLASH_FAILED;
}

static uint8_t reset(void)
{
    transmit_then_reset(NOTE_RESET);
    return RESULT_DONE;
}

static uint8_t run(uint8_t type, const __xdata uint8_t *payload, uint8_t length)
{
    switch (type) {
    case FRAME_CONFIGURE:
        return configure(payload);
    case FRAME_START:
        return start(payload, length);
    case FRAME_STOP:
        return unit_stop();
    case FRAME_SINGLE:
        return unit_single();
    case FRAME_HOME:
        return unit_home();
    case FRAME_GO_TO:
        return unit_go_to(get16(payload));
    case FRAME_CALIBRATE:
        return calibrate(payload);
    case FRAME_TRIM_TEMPERATURE:
        return thermometer_learn(get16(payload));
    case FRAME_STORE:
        return store();
    case FRAME_RESET:
        return reset();
    case FRAME_MEASURE:
        return unit_measure(payload[0]);
    case FRAME_UPDATE:
        return update_begin(get32(payload));
    default:
        return unit_set_waypoint(get16(payload));
    }
}

static bool is_repeat(uint8_t type, uint8_t request, uint32_t crc)
{
    return request != 0 && request == last.request && type == last.type && crc == last.crc &&
           last.age < REPEATS_WITHIN;
}

static void run_once(const __xdata uint8_t *frame, uint8_t length, uint32_t crc)
{
    uint8_t type = frame[0];
    uint8_t request = frame[1];
    if (!is_repeat(type, request, crc)) {
        last.result = run(type, frame + 2, length);
        last.request = request;
        last.type = type;
        last.crc = crc;
    }
    last.age = 0;
    transmit_result(request, type, last.result);
}

static void greet(uint8_t request, uint8_t protocol)
{
    last.request = 0; // a new host counts its requests from the start
    delivery_hasten();
    transmit_hello(request, protocol);
}

// Whether a FOR names another unit, or this one before its chip was erased.
static bool is_for_another(const __xdata uint8_t *frame)
{
    return get32(frame + 1) != settings_serial() || get32(frame + 5) != life_number();
}

uint8_t command_take(const __xdata uint8_t *frame, uint8_t length, uint32_t crc, uint32_t received)
{
    bool is_refused = false;
    if (frame[0] == FRAME_FOR) {
        if (length < FOR_BYTES + 2)
            return REASON_WRONG_LENGTH;
        is_refused = is_for_another(frame);
        frame += FOR_BYTES;
        length -= FOR_BYTES;
    }
    uint8_t type = frame[0];
    uint8_t request = frame[1];
    if (request_length(type) == REQUEST_UNKNOWN)
        return REASON_UNKNOWN_TYPE;
    if (!request_has_length(type, length))
        return REASON_WRONG_LENGTH;
    if (is_refused) {
        transmit_result(request, type, RESULT_NOT_FOR_THIS_UNIT);
        return REASON_NONE;
    }
    if (type != FRAME_ACK && type != FRAME_ACK_2 && last.age < REPEATS_WITHIN)
        last.age++;
    switch (type) {
    case FRAME_HELLO:
        greet(request, frame[2]);
        break;
    case FRAME_STATUS:
        transmit_status(request);
        break;
    case FRAME_CLOCK:
        transmit_clock(request, received);
        break;
    case FRAME_SETTINGS:
        transmit_settings(request);
        break;
    case FRAME_MECHANICS:
        transmit_mechanics(request);
        break;
    case FRAME_ACK:
    case FRAME_ACK_2:
        delivery_acknowledge(frame + 1, length - 1);
        break;
    default:
        run_once(frame, length, crc);
        break;
    }
    return REASON_NONE;
}
