"""What each field of each message may hold: one table, and check(), which every message passes when it is decoded.

A value beyond its bounds is an accident or an attack: it is far from all that a unit, a room or a clock can do, and
can break every program that computes with it. A field that is not set is not checked.
"""

from noctule.bounds.checking import check, decode
from noctule.bounds.kinds import Bound, Counts, Data, Many, Name, Number, Text
from noctule.bounds.table import (
    AIR_C,
    BOUNDS,
    MAX_READINGS,
    MAX_TILES,
    MAX_UNITS,
    MOST_SUSPECT,
    UNIT_PAUSE_S,
    UNIT_PLAN,
    UNKNOWN_SIGMA_POSITION_M,
    WRITTEN_HEADING_RAD,
    number,
    text,
)

__all__ = [
    "AIR_C",
    "BOUNDS",
    "MAX_READINGS",
    "MAX_TILES",
    "MAX_UNITS",
    "MOST_SUSPECT",
    "UNIT_PAUSE_S",
    "UNIT_PLAN",
    "UNKNOWN_SIGMA_POSITION_M",
    "WRITTEN_HEADING_RAD",
    "Bound",
    "Counts",
    "Data",
    "Many",
    "Name",
    "Number",
    "Text",
    "check",
    "decode",
    "number",
    "text",
]
