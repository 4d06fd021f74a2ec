"""The units of the wire: how many of a frame's integers make one SI unit. Read and written by the same table."""

from math import pi
from typing import NamedTuple

from noctule_gateway.clock.regression import TICK_S

PER_RADIAN = 65536 / (2 * pi)
PER_SECOND = 1000  # of a plan's times and of a pause
PER_HALF_STEP = 256
PER_KELVIN = 100

HALF_STEPS_PER_TURN = 25792 / 405 * 64  # of the usual gear, which a unit goes by until it is calibrated

BEARING_RAD = 2 * pi / 65536  # of one integer
TICKS_PER_OFFSET = 16
OFFSET_S = TICKS_PER_OFFSET * TICK_S


class Scale(NamedTuple):
    """A field of the bus, and how many of the wire's integers make one of its units."""

    field: str
    per_unit: float

    def from_wire(self, integer: int) -> float:
        """The value on the bus; a count stays an integer."""
        return integer if self.per_unit == 1 else integer / self.per_unit


# By the frame's field.
PLAN = {
    "first_bearing": Scale("first_bearing_rad", PER_RADIAN),
    "bearing_step": Scale("bearing_step_rad", PER_RADIAN),
    "count": Scale("count", 1),
    "ping_interval_ms": Scale("ping_interval_s", PER_SECOND),
    "top_speed": Scale("top_speed_half_steps_s", 1),
    "ramp_ms": Scale("ramp_s", PER_SECOND),
    "settle_ms": Scale("settle_s", PER_SECOND),
    "pings": Scale("pings", 1),
}
CALIBRATION = {
    "half_steps_per_turn": Scale("half_steps_per_turn", PER_HALF_STEP),
    "backlash": Scale("backlash_half_steps", 1),
    "home_bearing": Scale("home_bearing_rad", PER_RADIAN),
}
