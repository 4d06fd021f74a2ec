"""The table: what each field of each message may hold, and how large a message may be."""

import math

from noctule.bounds.kinds import Bound, Counts, Data, Many, Name, Number, Text

MAX_READINGS = 64  # a sweep, of a unit
MAX_UNITS = 4096  # of a site
MOST_SUSPECT = 1000  # sweeps before the one that names a fault
MAX_TILES = 4096  # of a grid on the bus: 64 rooms have some hundreds

_YEAR_2255_S = 9e9  # a count of nanoseconds in 64 bits ends soon after
_NUMBER_32 = Number(0, 2**32 - 1)
_NUMBER_53 = Number(0, 2**53 - 1)  # beyond, a double and so JavaScript and many databases no longer count
_ENUM = Number(0, 63)  # a newer sender may have a value that this version does not know

_NAME = Name()
_ID = Text(64)
_SENTENCES = Text(2000)

_PLACE_M = Number(-1e4, 1e4, "m", "in metres, from the site's origin")
_MAP_M = Number(-2e4, 2e4, "m")  # what was seen from there
_BEARING_RAD = Number(-2 * math.pi, 2 * math.pi, "rad")
_HEADING_RAD = Number(-200 * math.pi, 200 * math.pi, "rad")  # 100 turns
_CLOCK_ERROR_S = Number(0, _YEAR_2255_S, "s")
_COVARIANCE = Number(-1e18, 1e18)  # finite, and its square too
_SHARE = Number(-1e-6, 1 + 1e-6)  # 0 to 1, rounded
_NUMBER_16 = Number(0, 0xFFFF)
_HOUR_S = Number(0, 3600, "s")
_CHIP_C = Number(-330, 330, "degrees C")  # all that the line can carry: a broken thermometer must not hide a status

# A heading that a person writes into a file; one from a tracker may count turns.
WRITTEN_HEADING_RAD = Number(-2 * math.pi, 2 * math.pi, "rad", "in degrees, up to one turn")
# The most that sigma_position_m may be: a pose that states it is unknown, and its other fields mean nothing.
UNKNOWN_SIGMA_POSITION_M = 100.0
# Air as the unit's chip survives it.
AIR_C = Number(-60, 85, "degrees C", "in degrees Celsius, not kelvin")

# What a unit takes of a plan, and as a pause (firmware/README.md, CONFIGURE and START). Before firmware 0.6 it took up
# to 1000 half steps/s: a site file may still say so, and the gateway eases it.
UNIT_PLAN = {
    "first_bearing_rad": Number(-math.radians(148), math.radians(148), "rad"),
    "bearing_step_rad": Number(2 * math.pi / 0x10000, 2 * math.pi, "rad"),
    "count": Number(1, MAX_READINGS),
    "ping_interval_s": Number(0.029, 1, "s", "in seconds"),
    "top_speed_half_steps_s": Number(50, 1000, "half steps/s"),
    "ramp_s": Number(0, 1, "s", "in seconds"),
    "settle_s": Number(0, 1, "s", "in seconds"),
}
UNIT_PAUSE_S = Number(0, 65.535, "s", "in seconds")

BOUNDS: dict[str, dict[str, Bound]] = {
    "Timestamp": {
        "seconds": Number(0, _YEAR_2255_S, "s", "after 1970"),
        "nanos": Number(0, 999_999_999, "ns"),
    },
    # ---- Units
    "Pose": {
        "x_m": _PLACE_M,
        "y_m": _PLACE_M,
        "heading_rad": _HEADING_RAD,
        "sigma_position_m": Number(0, UNKNOWN_SIGMA_POSITION_M, "m", "in metres"),
        "sigma_heading_rad": Number(0, math.pi, "rad"),
    },
    "Sensor": {
        "beam_width_rad": Number(math.radians(0.1), math.pi, "rad", "the full width of the beam"),
        "range_bias_m": Number(-1, 1, "m", "in metres"),
        "range_sigma_m": Number(1e-4, 0.5, "m", "in metres"),
        "face_offset_m": Number(-0.2, 0.2, "m", "in metres"),
        "face_offset_sigma_m": Number(0, 0.1, "m", "in metres"),
    },
    "Reading": {
        "bearing_rad": _BEARING_RAD,
        "time_offset_s": _HOUR_S,
        "time_of_flight_s": Number(0, 4.5, "s"),  # all that the line can carry
        "status": _ENUM,
    },
    "Sweep": {
        "site": _NAME,
        "unit": _NAME,
        "log_id": _ID,
        "log_sequence": _NUMBER_53,
        "boot": _NUMBER_32,
        "sequence": _NUMBER_32,
        "clock_error_s": _CLOCK_ERROR_S,
        "waypoint": _NUMBER_16,
        "air_temperature_c": AIR_C,
        "readings": Many(MAX_READINGS),
        "clock_drift": Number(-0.5, 0.5, "s/s"),
        "clock_epoch": _ID,
        "life": _NUMBER_32,
        "faults": Many(16, _ENUM),
        "suspect_before": Number(0, MOST_SUSPECT),
    },
    "UnitFault": {
        "kind": _ENUM,
        "confidence": _SHARE,
        "words": _SENTENCES,
        "advice": _SENTENCES,
    },
    "UnitStatus": {
        "site": _NAME,
        "unit": _NAME,
        "state": _ENUM,
        "detail": _SENTENCES,
        "serial": _NUMBER_32,
        "firmware": _ID,
        "boot": _NUMBER_32,
        "waypoint": _NUMBER_16,
        "clock_error_s": _CLOCK_ERROR_S,
        "clock_drift": Number(-1e6, 1e6, "s/s"),  # a simulated unit runs as fast as it can
        "log_id": _ID,
        "log_head": _NUMBER_53,
        "log_tail": _NUMBER_53,
        "log_removed": _NUMBER_53,
        "log_damaged": _NUMBER_53,
        "counters": Counts(200, _ID, _NUMBER_53),
        "gateway": _NAME,
        "gateway_version": _ID,
        "reset_cause": Text(200),
        "chip_temperature_c": _CHIP_C,
        "faults": Many(16),
        "slip_rad": _BEARING_RAD,
    },
    # ---- Log and commands: wider than a unit takes, for its gateway answers an operator's mistake in words
    "LogRecords": {
        "log_id": _ID,
        "head": _NUMBER_53,
        "tail": _NUMBER_53,
        "sweeps": Many(1000),
        "gaps": Many(1000),
    },
    "LogGap": {
        "first": _NUMBER_53,
        "last": _NUMBER_53,
        "reason": _SENTENCES,
    },
    "SweepPlan": {
        "first_bearing_rad": _BEARING_RAD,
        "bearing_step_rad": _BEARING_RAD,
        "count": _NUMBER_16,
        "ping_interval_s": _HOUR_S,
        "top_speed_half_steps_s": _NUMBER_16,
        "ramp_s": _HOUR_S,
        "settle_s": _HOUR_S,
        "pings": _NUMBER_16,
    },
    "Calibration": {
        "half_steps_per_turn": _NUMBER_16,
        "backlash_half_steps": _NUMBER_16,
        "home": _ENUM,
        "home_bearing_rad": _BEARING_RAD,
    },
    "UnitSettings": {
        "temperature_trim_k": _CHIP_C,
    },
    "CommandRequest": {
        "request_id": _ID,
        "pause_s": _HOUR_S,
        "waypoint": _NUMBER_16,
        "bearing_rad": _BEARING_RAD,
        "temperature_c": _CHIP_C,
        "image": Data(2**20),  # a unit's whole flash is 0.2 MB of Intel HEX
    },
    "Caller": {
        "session": _ID,
        "certificate": Data(2**13),
        "signature": Data(2**8),  # DER; 72 bytes with P-256
    },
    "Measurement": {
        "name": _ID,
        "value": Number(-1e9, 1e9),
        "verdict": _ENUM,
        "words": _SENTENCES,
    },
    "CommandReply": {
        "request_id": _ID,
        "error": _SENTENCES,
        "detail": _SENTENCES,
        "measurements": Many(100),
    },
    # ---- Services
    "Cursor": {
        "unit": _NAME,
        "log_id": _ID,
        "log_sequence": _NUMBER_53,
    },
    "ServiceStatus": {
        "site": _NAME,
        "name": _NAME,
        "role": _ID,
        "version": _ID,
        "detail": _SENTENCES,
        "counters": Counts(200, _ID, _NUMBER_53),
        "cursors": Many(MAX_UNITS),
        "rerun": _ID,
        "rerun_recording": _ID,
    },
    # ---- Map
    "Point": {
        "x_m": _MAP_M,
        "y_m": _MAP_M,
    },
    "Wall": {
        "theta_rad": _BEARING_RAD,
        "rho_m": Number(-4e4, 4e4, "m"),
        "covariance": Many(4, _COVARIANCE),
        "readings": _NUMBER_32,
        "chance": _SHARE,
    },
    "Corner": {
        "x_m": _MAP_M,
        "y_m": _MAP_M,
        "covariance": Many(4, _COVARIANCE),
        "walls": Many(16, _NUMBER_32),
    },
    "Cylinder": {
        "x_m": _MAP_M,
        "y_m": _MAP_M,
        "radius_m": Number(0, 2e4, "m"),
        "covariance": Many(9, _COVARIANCE),
        "readings": _NUMBER_32,
    },
    "Touch": {
        "x_m": _MAP_M,
        "y_m": _MAP_M,
        "covariance": Many(4, _COVARIANCE),
        "unit": _NAME,
        "readings": _NUMBER_32,
        "direction_rad": _BEARING_RAD,
        "width_rad": _BEARING_RAD,
        "chance_wall": _SHARE,
        "chance_corner": _SHARE,
        "chance_cylinder": _SHARE,
    },
    "UnitPose": {
        "unit": _NAME,
        "x_m": _MAP_M,
        "y_m": _MAP_M,
        "heading_rad": _HEADING_RAD,
        "covariance": Many(9, _COVARIANCE),
        "state": _ENUM,
        "detail": _SENTENCES,
    },
    "Contour": {
        "site": _NAME,
        "mapper": _NAME,
        "version": _NUMBER_53,
        "method": _ID,
        "walls": Many(10_000),  # 64 rooms have some hundreds
        "corners": Many(10_000),
        "cylinders": Many(10_000),
        "touches": Many(10_000),
        "sweeps": _NUMBER_53,
        "note": _SENTENCES,
        "poses": Many(MAX_UNITS),
        "stops": Many(20_000),  # as many as sweeps
    },
    "FeaturePoint": {
        "x_m": _MAP_M,
        "y_m": _MAP_M,
        "reliability": _SHARE,
        "kind": _ENUM,
    },
    "Features": {
        "site": _NAME,
        "mapper": _NAME,
        "version": _NUMBER_53,
        "points": Many(100_000),
    },
    "GridTile": {
        "site": _NAME,
        "mapper": _NAME,
        "tile_x": Number(-(2**20), 2**20),
        "tile_y": Number(-(2**20), 2**20),
        "x_m": _MAP_M,
        "y_m": _MAP_M,
        "cell_m": Number(1e-3, 10, "m"),
        "columns": Number(0, 256),  # the largest tile that a mapper can be configured for
        "rows": Number(0, 256),
        "occupied": Data(256 * 256),
        "free": Data(256 * 256),
    },
}

SMALL_BYTES = 2**18
PAYLOAD_BYTES = {
    "LogRecords": 2**22,
    "Contour": 2**22,
    "Features": 2**22,
    "ServiceStatus": 2**20,
    "CommandRequest": 2**21,
}


def number(message: str, field: str) -> Number:
    """The bounds of a field that holds a number."""
    bound = BOUNDS[message][field]
    assert isinstance(bound, Number)
    return bound


def text(message: str, field: str) -> Text:
    """The bounds of a field that holds text."""
    bound = BOUNDS[message][field]
    assert isinstance(bound, Text)
    return bound
