// The loader at the line, by the table in ../README.md, Update. Each frame may come again: it is answered alike.
#include "serve.h"

#include "../hal/reset.h"
#include "../hal/watchdog.h"
#include "../src/core/little_endian.h"
#include "../src/core/protocol.h"
#include "application.h"
#include "checksum.h"
#include "chip.h"
#include "image.h"
#include "install.h"
#include "line.h"
#include "page.h"
#include "serial.h"

#define LOADER_VERSION 2 // 2: guards the supply first of all
#define ANNOUNCE_AFTER CHIP_COUNTS_PER_S
#define LEAVE_AFTER (60 * CHIP_COUNTS_PER_S)
#define PUT_HEADER_BYTES 4 // type, request, offset

static uint8_t reason_to_stay; // enum stay, as things are now
static uint8_t obstacle; // to starting the application now, enum stay
static uint8_t quiet; // counts since the last sound frame, or since the loader last spoke up
static uint16_t idle; // counts since the last frame that only a loader obeys: a gateway's HELLO keeps none here

static void tell_loader(uint8_t request)
{
    bool there = obstacle != STAY_NO_APPLICATION;
    uint32_t serial = serial_number(); // before the frame is begun: there is one checksum at a time
    line_begin(FRAME_LOADER);
    line_put8(request);
    line_put8(PROTOCOL_VERSION);
    line_put32(serial);
    line_put8(IMAGE_HARDWARE);
    line_put8(LOADER_VERSION);
    line_put8(reason_to_stay);
    for (uint8_t i = 0; i < 3; i++)
        line_put8(there ? flash_read(APPLICATION + DESCRIPTION_VERSION + i) : 0xFF);
    line_send();
}

static void tell_result(uint8_t request, uint8_t command, uint8_t result)
{
    line_begin(FRAME_RESULT);
    line_put8(request);
    line_put8(command);
    line_put8(result);
    line_send();
}

static void reject(uint8_t reason)
{
    uint8_t type = reason == REASON_UNREADABLE ? 0 : line_frame[0];
    line_begin(FRAME_REJECTED);
    line_put8(reason);
    line_put8(type);
    line_send();
}

static uint8_t put(void)
{
    uint16_t offset = get16(line_frame + 2);
    uint8_t bytes = line_length - PUT_HEADER_BYTES;
    if (offset > FLASH_PAGE_BYTES - bytes)
        return RESULT_OUT_OF_RANGE;
    for (uint8_t i = 0; i < bytes; i++)
        page_image[offset + i] = line_frame[PUT_HEADER_BYTES + i];
    return RESULT_DONE;
}

static uint8_t program(void)
{
    uint8_t page = line_frame[2];
    uint32_t crc = get32(line_frame + 3);
    if (page >= IMAGE_PAGES)
        return RESULT_OUT_OF_RANGE;
    uint16_t address = STAGING + (uint16_t)page * FLASH_PAGE_BYTES;
    if (page_crc() == crc)
        return page_program(address) ? RESULT_DONE : RESULT_FLASH_FAILED;
    return checksum_of_flash(address, FLASH_PAGE_BYTES) == crc ? RESULT_DONE : RESULT_BAD_CRC;
}

static uint8_t install_now(void)
{
    uint8_t result = install();
    obstacle = application_obstacle();
    if (result == RESULT_DONE)
        reason_to_stay = STAY_ASKED; // only the host is waited for now
    else if (result == RESULT_FLASH_FAILED)
        reason_to_stay = STAY_FLASH_FAILED;
    return result;
}

// Whether RUN can be obeyed.
static uint8_t may_run(void)
{
    switch (obstacle) {
    case STAY_NONE:
        return RESULT_DONE;
    case STAY_NOT_CONFIRMED:
        return RESULT_OUT_OF_RANGE;
    default:
        return RESULT_BAD_CRC;
    }
}

static uint8_t obey(uint8_t type)
{
    switch (type) {
    case FRAME_PUT:
        return put();
    case FRAME_PROGRAM:
        return program();
    case FRAME_INSTALL:
        return install_now();
    default:
        return may_run();
    }
}

static uint8_t length_reason(uint8_t type)
{
    uint8_t expected;
    switch (type) {
    case FRAME_PUT:
        return line_length > PUT_HEADER_BYTES ? REASON_NONE : REASON_WRONG_LENGTH;
    case FRAME_HELLO:
        expected = 3;
        break;
    case FRAME_PROGRAM:
        expected = 7;
        break;
    case FRAME_INSTALL:
    case FRAME_RUN:
        expected = 2;
        break;
    default:
        return REASON_UNKNOWN_TYPE;
    }
    return line_length == expected ? REASON_NONE : REASON_WRONG_LENGTH;
}

static void take_frame(void)
{
    uint8_t type = line_frame[0];
    uint8_t request = line_frame[1];
    uint8_t reason = length_reason(type);
    quiet = 0;
    if (reason != REASON_NONE) {
        reject(reason);
    } else if (type == FRAME_HELLO) {
        tell_loader(request);
    } else {
        uint8_t result = obey(type);
        idle = 0;
        tell_result(request, type, result);
        if (type == FRAME_RUN && result == RESULT_DONE)
            reset_now(NOTE_LOADER);
    }
}

static void count_time(void)
{
    if (++quiet == ANNOUNCE_AFTER) {
        quiet = 0;
        tell_loader(REQUEST_NONE);
    }
    if (++idle == LEAVE_AFTER) {
        idle = 0;
        if (obstacle == STAY_NONE)
            reset_now(NOTE_LOADER);
    }
}

void serve(uint8_t reason)
{
    reason_to_stay = reason;
    obstacle = application_obstacle();
    line_start();
    tell_loader(REQUEST_NONE);
    for (;;) {
        watchdog_feed();
        uint8_t come = line_receive();
        if (come == LINE_FRAME)
            take_frame();
        else if (come != REASON_NONE)
            reject(come);
        if (chip_has_counted())
            count_time();
    }
}
