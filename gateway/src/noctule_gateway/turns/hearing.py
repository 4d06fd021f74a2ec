"""Which units could hear each other's pings, as far as their places tell. Pure geometry."""

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, radians, sin

# A sensor hears its own echo from 4 m, which has come 8 m; another's ping that has come as far is as loud.
HEARD_AFTER_M = 8.0
# Half the angle in which a sensor speaks and hears, at its widest (0.3 m and nearer).
LOBE_RAD = radians(20)

_DIRECTIONS = 90
_STEPS = 16


@dataclass(frozen=True)
class Place:
    """Where a unit stands and into which arc its sensor looks: from ``first_rad`` on anticlockwise by ``width_rad``."""

    x_m: float
    y_m: float
    first_rad: float
    width_rad: float
    sigma_m: float = 0.0

    def looks_along(self, direction_rad: float) -> bool:
        """Whether the arc holds ``direction_rad``."""
        return (direction_rad - self.first_rad) % (2 * pi) <= self.width_rad

    def looks_at(self, x_m: float, y_m: float) -> bool:
        """Whether the arc holds that point."""
        return self.looks_along(atan2(y_m - self.y_m, x_m - self.x_m))


def could_hear(one: Place, other: Place) -> bool:
    """Whether sound could come from one to the other, straight or off a wall, which may be anywhere.

    Off a wall it leaves the one and reaches the other inside both arcs, and has come HEARD_AFTER_M at most: so the wall
    touches the ellipse that has the two for its foci. The relation is symmetric.
    """
    reach_m = HEARD_AFTER_M + 3 * (one.sigma_m + other.sigma_m)
    apart_m = hypot(other.x_m - one.x_m, other.y_m - one.y_m)
    if apart_m >= reach_m:
        return False
    if one.looks_at(other.x_m, other.y_m) and other.looks_at(one.x_m, one.y_m):
        return True
    return _over_a_wall(one, other, reach_m, apart_m) or _over_a_wall(other, one, reach_m, apart_m)


def _over_a_wall(one: Place, other: Place, reach_m: float, apart_m: float) -> bool:
    """Whether any of some points before ``one`` and within the ellipse is before ``other``."""
    straight_rad = atan2(other.y_m - one.y_m, other.x_m - one.x_m)
    for number in range(_DIRECTIONS):
        direction_rad = one.first_rad + one.width_rad * number / (_DIRECTIONS - 1)
        # From ``one`` as a focus, the ellipse of the points whose distances from both have the sum reach.
        furthest_m = (reach_m**2 - apart_m**2) / (2 * (reach_m - apart_m * cos(direction_rad - straight_rad)))
        for step in range(1, _STEPS + 1):
            range_m = furthest_m * step / _STEPS
            if other.looks_at(one.x_m + range_m * cos(direction_rad), one.y_m + range_m * sin(direction_rad)):
                return True
    return False
