"""Labels on the map that do not lie on each other: each tries a few places, and one that finds none is left out."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, cos, hypot, sin, sqrt, tau

from noctule import walls
from noctule.messages_pb2 import Contour, Cylinder, Wall
from noctule_mapper.contour import touch_marks

Place = tuple[float, float]

# Of a page of 1280 to 760 pixels, whose bounds have grown with the map and leave it some 60 % of their side. Who zooms
# in has room to spare.
_MAP_SIDE_PX = 340.0
_LETTER_PX, _PADDING_PX, _HEIGHT_PX = 7.0, 12.0, 20.0
_HANGS_PX = 10.0  # Rerun draws the middle of a label so far below its place
_DOT_PX = 12.0  # across a unit
_FROM_A_DOT_PX = 18.0  # the middle of a label below or above what it names
_FROM_A_WALL_PX = 6.0  # the edge of a label beside it
_ASIDE = 1.05  # of a label's width: one beside a unit then clears those below the units next to it
_BESIDE = 4  # of the places around something, those that are next to it
_ALONG_A_WALL = (0.5, 0.35, 0.65, 0.2, 0.8)
_CHORDS = 16  # of a circle: no farther from it than a fiftieth of its radius
_LEAST_SIDE_M = 1.0
_TOLD_FROM_M = 0.01


@dataclass(frozen=True)
class Label:
    """``text`` about something of that ``kind`` (unit, cylinder, wall, touch), centred at a place in metres."""

    kind: str
    text: str
    place_m: Place


def labels(contour: Contour, units_m: Mapping[str, Place]) -> list[Label]:
    """Names of units, then radii of cylinders, lengths of walls, the longest first, and what touches may be.

    Where there is room a standard deviation from a centimetre on stands beside them: of a radius, and across a wall.
    """
    px_m = _side_m(contour, units_m) / _MAP_SIDE_PX
    placed: list[Label] = []
    for choices in _wanted(contour, units_m, px_m):
        free = next((one for one in choices if not any(_overlap(one, other, px_m) for other in placed)), None)
        if free is not None:
            placed.append(free)
    return placed


def _wanted(contour: Contour, units_m: Mapping[str, Place], px_m: float) -> Iterator[list[Label]]:
    """For each label, the most important first, the places that would do, the best first."""
    units = list(units_m.values())
    for names, place in _sharing_a_label(units_m, px_m):
        choices = _around("unit", ", ".join(names), place, px_m)
        yield [*_clearest(choices[:_BESIDE], contour, units, px_m), *choices[_BESIDE:]]
    for cylinder in contour.cylinders:
        here, radius = (cylinder.x_m, cylinder.y_m), f"r {cylinder.radius_m:.2f} m"
        known = _error(sqrt(max(0.0, cylinder.covariance[8]))) if len(cylinder.covariance) == 9 else ""
        yield [one for text in _longest_first(radius, known) for one in _around("cylinder", text, here, px_m)]
    for wall in sorted(contour.walls, key=_length_m, reverse=True):
        chance = f", {100 * wall.chance:.1f} %" if wall.HasField("chance") else ""
        length = f"{_length_m(wall):.2f} m{chance}"
        known = _error(walls.middle_sigma_m(wall) or 0.0)
        texts = _longest_first(length, known)
        on = [[Label("wall", text, _on_wall(wall, share)) for share in _ALONG_A_WALL] for text in texts]
        beside = [one for share in _ALONG_A_WALL for one in _beside_a_wall(length, _on_wall(wall, share), px_m)]
        yield [label for choices in (*on, beside) for label in _clearest(choices, None, units, px_m)]
    for touch in contour.touches:
        yield _around("touch", touch_marks.label(touch), (touch.x_m, touch.y_m), px_m)


def _sharing_a_label(units_m: Mapping[str, Place], px_m: float) -> list[tuple[list[str], Place]]:
    """Units that stand at one place share a label."""
    groups: list[tuple[list[str], Place]] = []
    for unit, place in units_m.items():
        near = (names for names, other in groups if _apart_m(place, other) < _HEIGHT_PX * px_m)
        if (names := next(near, None)) is not None:
            names.append(unit)
        else:
            groups.append(([unit], place))
    return groups


def _longest_first(text: str, error: str) -> list[str]:
    return [f"{text} {error}", text] if error else [text]


def _error(sigma_m: float) -> str:
    """``±3 cm``: one standard deviation, rounded up; empty below a centimetre, which is no wider than the line."""
    return f"±{ceil(1e2 * sigma_m - 1e-6)} cm" if sigma_m >= _TOLD_FROM_M else ""


def _around(kind: str, text: str, place: Place, px_m: float) -> list[Label]:
    """Below, above, and beside what is at ``place``, then at its corners, and a row farther below and above."""
    up_m, aside_m, hangs_m = _FROM_A_DOT_PX * px_m, _ASIDE * _width_m(text, px_m), _HANGS_PX * px_m
    row_m = up_m + _HEIGHT_PX * px_m
    beside = ((0.0, -up_m), (0.0, up_m), (aside_m, 0.0), (-aside_m, 0.0))
    corners = ((aside_m, -up_m), (-aside_m, -up_m), (aside_m, up_m), (-aside_m, up_m))
    shifts = (*beside, *corners, (0.0, -row_m), (0.0, row_m))
    return [Label(kind, text, (place[0] + x_m, place[1] + y_m + hangs_m)) for x_m, y_m in shifts]


def _beside_a_wall(text: str, place: Place, px_m: float) -> list[Label]:
    """To the left, right, below and above."""
    aside_m, up_m = _width_m(text, px_m) / 2 + _FROM_A_WALL_PX * px_m, _FROM_A_DOT_PX * px_m
    shifts = ((-aside_m, 0.0), (aside_m, 0.0), (0.0, -up_m), (0.0, up_m))
    return [Label("wall", text, (place[0] + x_m, place[1] + y_m + _HANGS_PX * px_m)) for x_m, y_m in shifts]


def _clearest(choices: Sequence[Label], contour: Contour | None, units_m: Sequence[Place], px_m: float) -> list[Label]:
    """``choices``, those first that cover the fewest of ``units_m``, since a label on a unit would seem to name the
    unit; then those that cover the least of the walls and cylinders of ``contour``. Equal ones keep their order.
    """
    walls_m = contour.walls if contour is not None else ()
    drawn = [((each.start.x_m, each.start.y_m), (each.end.x_m, each.end.y_m)) for each in walls_m]
    drawn += [chord for circle in (contour.cylinders if contour is not None else ()) for chord in _ring_m(circle)]
    half_dot_m = _DOT_PX * px_m / 2
    dots = [((x_m - half_dot_m, y_m), (x_m + half_dot_m, y_m)) for x_m, y_m in units_m]

    def covered(label: Label) -> tuple[int, int]:
        centre_m = (label.place_m[0], label.place_m[1] - _HANGS_PX * px_m)
        half_m = (_width_m(label.text, px_m) / 2, _HEIGHT_PX * px_m / 2)
        over_m = sum(_in_box_m(line, centre_m, half_m) for line in drawn)
        return sum(_in_box_m(dot, centre_m, half_m) > 0.0 for dot in dots), round(over_m / px_m)

    return sorted(choices, key=covered)


def _ring_m(circle: Cylinder) -> list[tuple[Place, Place]]:
    """The chords that a circle is drawn as here."""
    angles_rad = [tau * number / _CHORDS for number in range(_CHORDS)]
    rim_m = [(circle.x_m + circle.radius_m * cos(at), circle.y_m + circle.radius_m * sin(at)) for at in angles_rad]
    return list(zip(rim_m, [*rim_m[1:], rim_m[0]], strict=True))


def _in_box_m(line: tuple[Place, Place], centre_m: Place, half_m: Place) -> float:
    """How long the part of ``line`` is in the box that reaches ``half_m`` to each side of ``centre_m``."""
    first, last = 0.0, 1.0
    for start, end, centre, half in zip(*line, centre_m, half_m, strict=True):
        way, low, high = end - start, centre - half - start, centre + half - start
        if way == 0.0:
            if not low < 0.0 < high:
                return 0.0
            continue
        first, last = max(first, min(low / way, high / way)), min(last, max(low / way, high / way))
    return max(0.0, last - first) * _apart_m(*line)


def _overlap(one: Label, other: Label, px_m: float) -> bool:
    wide_m = (_width_m(one.text, px_m) + _width_m(other.text, px_m)) / 2
    across_m, up_m = (abs(first - second) for first, second in zip(one.place_m, other.place_m, strict=True))
    return across_m < wide_m and up_m < _HEIGHT_PX * px_m


def _width_m(text: str, px_m: float) -> float:
    return (_LETTER_PX * len(text) + _PADDING_PX) * px_m


def _side_m(contour: Contour, units_m: Mapping[str, Place]) -> float:
    """The larger side of all that is labelled."""
    ends = [(end.x_m, end.y_m) for wall in contour.walls for end in (wall.start, wall.end)]
    centres = [(each.x_m, each.y_m) for each in (*contour.cylinders, *contour.touches)]
    places: Sequence[Place] = [*ends, *centres, *units_m.values()]
    if not places:
        return _LEAST_SIDE_M
    return max(_LEAST_SIDE_M, *(max(axis) - min(axis) for axis in zip(*places, strict=True)))


def _on_wall(wall: Wall, share: float) -> Place:
    return (
        wall.start.x_m + share * (wall.end.x_m - wall.start.x_m),
        wall.start.y_m + share * (wall.end.y_m - wall.start.y_m),
    )


def _length_m(wall: Wall) -> float:
    return _apart_m((wall.start.x_m, wall.start.y_m), (wall.end.x_m, wall.end.y_m))


def _apart_m(one: Place, other: Place) -> float:
    return hypot(one[0] - other[0], one[1] - other[1])
