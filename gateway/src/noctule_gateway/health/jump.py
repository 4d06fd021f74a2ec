"""All ranges longer or shorter by one share, or one length: the air's temperature is wrong, or the sensor's clock.

Told apart from a motion by direction: marks on opposite sides that grow alike were not moved towards.
"""

import math
from dataclasses import dataclass
from statistics import median

from noctule_gateway.health.marks import Mark

_LEAST_SHARE = 0.012  # of a range: 7 kelvin
_LEAST_SHARE_ASSUMED = 0.03  # 17 kelvin: where nobody measures the air's temperature, a heating does less
_LEAST_M = 0.03
_FITS_M = 0.015
_LEAST_SPREAD_RAD = math.radians(100.0)
_LEAST_MARKS = 3
_FITTING_SHARE = 0.75


@dataclass(frozen=True)
class Jump:
    """``fitting`` marks fit it; ``share`` is by how much of its range the median mark is longer; ``words`` says it."""

    fitting: int
    share: float
    words: str


def jump_of(marks: list[Mark]) -> Jump | None:
    """The share or the length by which most marks are off, whichever fits more; None where there is none."""
    if len(marks) < _LEAST_MARKS:
        return None
    share = median(one.longer_m / one.range_m for one in marks)
    length_m = median(one.longer_m for one in marks)
    by_share = [one for one in marks if abs(one.longer_m - share * one.range_m) <= _FITS_M]
    by_length = [one for one in marks if abs(one.longer_m - length_m) <= _FITS_M]
    found = []
    if abs(share) >= _LEAST_SHARE and _enough(by_share, marks):
        found.append(Jump(len(by_share), share, f"all ranges are {share:+.1%}"))
    if abs(length_m) >= _LEAST_M and _enough(by_length, marks):
        found.append(Jump(len(by_length), share, f"all ranges are {100 * length_m:+.0f} cm"))
    return max(found, key=lambda one: one.fitting, default=None)


def is_air(jump: Jump, air_measured: bool) -> bool:
    """The air may have become so much warmer or colder than it was assumed to be: no fault."""
    return not air_measured and abs(jump.share) < _LEAST_SHARE_ASSUMED


def _enough(fitting: list[Mark], marks: list[Mark]) -> bool:
    if len(fitting) < max(_LEAST_MARKS, _FITTING_SHARE * len(marks)):
        return False
    directions = [one.direction_rad for one in fitting]
    return max(directions) - min(directions) >= _LEAST_SPREAD_RAD
