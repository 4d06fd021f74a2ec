"""What a person says of the file: which column is what, in which units, and where the scanner stood."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from noctule.site import Pose2

AIR_TEMPERATURE_C = 20.0
STATED_SIGMA_M, STATED_SIGMA_DEG = 0.01, 1.0  # of a pose that someone has measured with care

METRES = {
    **dict.fromkeys(("mm", "millimetres", "millimeters"), 1e-3),
    **dict.fromkeys(("cm", "centimetres", "centimeters"), 1e-2),
    **dict.fromkeys(("m", "metres", "meters", "metre", "meter"), 1.0),
    **dict.fromkeys(("in", "inch", "inches", '"'), 0.0254),
    **dict.fromkeys(("ft", "feet", "foot"), 0.3048),
}
SECONDS = {
    **dict.fromkeys(("us", "µs", "micros", "microseconds"), 1e-6),
    **dict.fromkeys(("ms", "millis", "milliseconds"), 1e-3),
    **dict.fromkeys(("s", "sec", "seconds"), 1.0),
}
DEGREES = {
    **dict.fromkeys(("deg", "degree", "degrees", "°", "º"), 1.0),
    **dict.fromkeys(("rad", "radian", "radians"), 57.29577951308232),
}


@dataclass(frozen=True)
class Columns:
    """Columns by their names or by their numbers from 1; None where the file has none."""

    angle: str
    range: str
    time: str | None = None
    sweep: str | None = None  # a new value begins a new sweep
    x: str | None = None
    y: str | None = None
    heading: str | None = None

    def wanted(self) -> dict[str, str]:
        """Those that were named, by what they hold."""
        return {what: column for what, column in vars(self).items() if column is not None}


@dataclass(frozen=True)
class ScanOptions:
    """Units are None where the file is to say them, in a column's name or beside its figures."""

    columns: Columns
    units: str | None = None  # of ranges
    angle_units: str | None = None
    time_units: str | None = None
    place_units: str | None = None  # of x and y
    no_echo: tuple[str, ...] = ()  # what stands for a range where nothing was heard
    no_echo_above: float | None = None  # in the file's units
    clockwise: bool = False
    forward_deg: float = 0.0  # the file's angle at which the scanner looks forward
    pose: "Pose2 | None" = None  # None: the scanner's place and forward direction are the site's frame
    sigma_position_m: float = STATED_SIGMA_M
    sigma_heading_deg: float = STATED_SIGMA_DEG
    air_temperature_c: float = AIR_TEMPERATURE_C
    speed_of_sound_m_s: float | None = None  # by which the scanner's program reckons; None: that of the air
    skip_bad_lines: bool = False
    site: str = "scan"
    unit: str = "scanner"
