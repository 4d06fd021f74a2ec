// The numbers of the serial protocol; ../../README.md has the table of frames and is the last word.
#ifndef PROTOCOL_H
#define PROTOCOL_H

#define PROTOCOL_VERSION 3
#define PROTOCOL_WITH_LIFE 3 // since which HELLO tells it

enum frame_type {
    FRAME_HELLO = 0x01,
    FRAME_STATUS = 0x02,
    FRAME_CLOCK = 0x03,
    FRAME_CONFIGURE = 0x04,
    FRAME_START = 0x05,
    FRAME_STOP = 0x06,
    FRAME_SINGLE = 0x07,
    FRAME_HOME = 0x08,
    FRAME_SET_WAYPOINT = 0x09,
    FRAME_GO_TO = 0x0A,
    FRAME_CALIBRATE = 0x0B,
    FRAME_TRIM_TEMPERATURE = 0x0C,
    FRAME_STORE = 0x0D,
    FRAME_RESET = 0x0E,
    FRAME_SETTINGS = 0x0F,
    FRAME_ACK_2 = 0x10, // of protocol 2, for sweeps of protocol 2
    FRAME_UPDATE = 0x11,
    FRAME_ACK = 0x12,
    FRAME_FOR = 0x13, // names the unit that the frame in it is for
    FRAME_MEASURE = 0x14,
    FRAME_MECHANICS = 0x15,

    FRAME_PUT = 0x20, // from here on to the loader only
    FRAME_PROGRAM = 0x21,
    FRAME_INSTALL = 0x22,
    FRAME_RUN = 0x23,

    FRAME_HELLO_ANSWER = 0x81,
    FRAME_STATUS_ANSWER = 0x82,
    FRAME_CLOCK_ANSWER = 0x83,
    FRAME_RESULT = 0x84,
    FRAME_REJECTED = 0x85,
    FRAME_SETTINGS_ANSWER = 0x86,
    FRAME_MECHANICS_ANSWER = 0x87,
    FRAME_LOADER = 0x8A,
    FRAME_SWEEP_2 = 0x90, // of protocol 2; the ring may still hold some when the firmware has been updated
    FRAME_SWEEP = 0x91,
};

#define REQUEST_NONE 0 // what the unit sends unasked

enum result {
    RESULT_DONE,
    RESULT_BUSY,
    RESULT_OUT_OF_RANGE,
    RESULT_NOT_HOMED,
    RESULT_FLASH_FAILED,
    RESULT_BAD_CRC,
    RESULT_NOT_FOR_THIS_UNIT,
};

enum reason { REASON_NONE, REASON_UNREADABLE, REASON_UNKNOWN_TYPE, REASON_WRONG_LENGTH, REASON_TOO_LONG };

enum state { STATE_IDLE, STATE_SWEEPING, STATE_HOMING, STATE_WAITING, STATE_FAULT, STATE_PAUSING, STATE_TURNING, STATE_MEASURING };

// What MEASURE measures: play, by one edge of the home switch from both sides; a turn, from edge to edge; a round of
// a sweep's way; one ping.
enum measure_kind { MEASURE_PLAY, MEASURE_TURN, MEASURE_ROUND, MEASURE_PING };

enum measure_outcome {
    MEASURED_NOTHING,
    MEASURED_UNDER_WAY,
    MEASURED_DONE,
    MEASURED_NO_SWITCH,
    MEASURED_STAYS_CLOSED,
    MEASURED_STOPPED,
};

enum fault { FAULT_NONE, FAULT_NO_HOME_SWITCH, FAULT_HOME_STAYS_CLOSED };

// Why the loader does not start the application.
enum stay { STAY_ASKED, STAY_NO_APPLICATION, STAY_NOT_CONFIRMED, STAY_FLASH_FAILED, STAY_NONE };

#define PUT_BYTES 128 // at most

#define STATUS_HOMED 0x01
#define STATUS_STARTED 0x02
#define STATUS_SLIPPED 0x04
#define STATUS_IN_TURN 0x08
#define STATUS_NUMBER_SHIFT 4 // of what MECHANICS tells: a host that sees another asks

#define SWEEP_DECREASING 0x01
#define SWEEP_SLIPPED 0x02
#define SWEEP_SUSPECT_SHIFT 2 // sweeps before this one
#define BEARING_UNKNOWN 0x7FFF
#define TEMPERATURE_NOT_MEASURED 0x7FFF
#define WAYPOINT_NONE 0xFFFF
#define SERIAL_NONE 0xFFFFFFFFUL

// What a reading's echo says when there is no time of flight.
#define ECHO_NONE 0xFFFFFFUL
#define ECHO_TOO_EARLY 0xFFFFFEUL
#define ECHO_STUCK_HIGH 0xFFFFFDUL
#define ECHO_NO_SENSOR 0xFFFFFCUL

#endif
