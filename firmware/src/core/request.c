// The length of each request, by the table in ../../README.md.
#include "request.h"

#include "protocol.h"

bool request_has_length(uint8_t type, uint8_t length)
{
    return length == request_length(type) || (type == FRAME_START && length == REQUEST_FREE_START);
}

uint8_t request_length(uint8_t type)
{
    switch (type) {
    case FRAME_STATUS:
    case FRAME_CLOCK:
    case FRAME_STOP:
    case FRAME_SINGLE:
    case FRAME_HOME:
    case FRAME_STORE:
    case FRAME_RESET:
    case FRAME_SETTINGS:
    case FRAME_MECHANICS:
        return 2;
    case FRAME_HELLO:
    case FRAME_MEASURE:
        return 3;
    case FRAME_SET_WAYPOINT:
    case FRAME_GO_TO:
    case FRAME_TRIM_TEMPERATURE:
        return 4;
    case FRAME_UPDATE:
        return 6;
    case FRAME_ACK_2:
        return 7;
    case FRAME_CALIBRATE:
        return 10;
    case FRAME_START:
        return 14;
    case FRAME_ACK:
        return 15;
    case FRAME_CONFIGURE:
        return 16;
    default:
        return REQUEST_UNKNOWN;
    }
}
