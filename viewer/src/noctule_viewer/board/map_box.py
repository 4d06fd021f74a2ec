"""The part of the site's plane that the viewer shows: fixed, so that neither time travel nor a sweep moves the map."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import ceil, floor, log10

from noctule.messages_pb2 import Contour

Point = tuple[float, float]

_MARGIN = 0.12  # of the larger side
_LEAST_MARGIN_M = 0.4
_HEARD_M = 2.0  # around units, before there is a map: most of what they hear
_GROWS_BY = 0.5  # of the larger side: a survey that grows a hundredfold needs a dozen boxes
_SHRINKS_BELOW = 0.4  # of a side
_MOST_LINES = 12


@dataclass(frozen=True)
class MapBox:
    """A rectangle in the site's frame, in metres."""

    left_m: float
    bottom_m: float
    right_m: float
    top_m: float
    of_map: bool = field(default=True, compare=False)  # or of where the units stand, before there was a map

    def holds(self, other: "MapBox") -> bool:
        """Whether ``other`` lies inside."""
        return (
            self.left_m <= other.left_m
            and self.bottom_m <= other.bottom_m
            and self.right_m >= other.right_m
            and self.top_m >= other.top_m
        )

    @property
    def side_m(self) -> float:
        """The larger side."""
        return max(self.right_m - self.left_m, self.top_m - self.bottom_m)


def shown(contour: Contour | None, units_m: Iterable[Point], before: MapBox | None) -> MapBox | None:
    """What to show of ``contour`` and units that stand at ``units_m``: as ``before`` while it fits well enough; None
    where there is nothing to show. The first map is fitted afresh, however well the units alone had fitted.
    """
    map_m = _points_m(contour) if contour is not None else []
    touches_m = [(touch.x_m, touch.y_m) for touch in contour.touches] if contour is not None else []
    points_m = [*units_m, *touches_m, *map_m]
    if not points_m:
        return before
    xs, ys = zip(*points_m, strict=True)
    tight = MapBox(min(xs), min(ys), max(xs), max(ys))
    of_map = bool(map_m)
    fits = not of_map or (before is not None and tight.side_m >= _SHRINKS_BELOW * before.side_m)
    if before is not None and before.of_map >= of_map and fits:
        return before if before.holds(tight) else _grown(before, tight)
    margin_m = max(_LEAST_MARGIN_M if of_map else _HEARD_M, _MARGIN * tight.side_m)
    return MapBox(
        tight.left_m - margin_m, tight.bottom_m - margin_m, tight.right_m + margin_m, tight.top_m + margin_m, of_map
    )


def _grown(before: MapBox, tight: MapBox) -> MapBox:
    """``before``, moved out beyond ``tight`` on the sides where that lies outside."""
    more_m = _GROWS_BY * tight.side_m
    return MapBox(
        before.left_m if before.left_m <= tight.left_m else tight.left_m - more_m,
        before.bottom_m if before.bottom_m <= tight.bottom_m else tight.bottom_m - more_m,
        before.right_m if before.right_m >= tight.right_m else tight.right_m + more_m,
        before.top_m if before.top_m >= tight.top_m else tight.top_m + more_m,
        before.of_map,
    )


def line_spacing_m(box: MapBox) -> float:
    """Of the scale's lines: 1, 2 or 5 of a power of ten, so that no side has more than a dozen."""
    least_m = box.side_m / _MOST_LINES
    decade = 10.0 ** floor(log10(least_m))
    return next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= least_m)


def multiples(first_m: float, last_m: float, spacing_m: float) -> list[float]:
    """The multiples of ``spacing_m`` from ``first_m`` to ``last_m``."""
    return [number * spacing_m for number in range(ceil(first_m / spacing_m), floor(last_m / spacing_m) + 1)]


def _points_m(contour: Contour) -> list[Point]:
    walls = [(end.x_m, end.y_m) for wall in contour.walls for end in (wall.start, wall.end)]
    circles = [
        (cylinder.x_m + side * cylinder.radius_m, cylinder.y_m + side * cylinder.radius_m)
        for cylinder in contour.cylinders
        for side in (-1, 1)
    ]
    return [*walls, *circles]
