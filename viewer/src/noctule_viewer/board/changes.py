"""What has newly appeared on the map, and what is gone from it, for some minutes after."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import acos, cos, degrees, hypot, pi, sin

from noctule.messages_pb2 import Contour

Point = tuple[float, float]

SHOWN_S = 600.0
_SETTLES_S = 120.0  # a map that has just begun: all of it is new
_GONE_AFTER_S = 20.0  # what is missing from one contour may be in the next one
_SAME_PLACE_M, _SAME_DIRECTION_DEG = 0.15, 8.0
_MOST_OBJECTS = 500
_LABEL_AT = 0.1  # of a wall


@dataclass(frozen=True)
class Object:
    """A wall from ``start`` to ``end``, or a cylinder about ``start`` of ``radius_m``."""

    kind: str
    start: Point
    end: Point
    radius_m: float = 0.0

    @cached_property
    def middle(self) -> Point:
        """Half way along."""
        return (self.start[0] + self.end[0]) / 2, (self.start[1] + self.end[1]) / 2

    @property
    def label_place(self) -> Point:
        """Where its label belongs: a wall's length stands at its middle."""
        (x_m, y_m), (end_x_m, end_y_m) = self.start, self.end
        return x_m + _LABEL_AT * (end_x_m - x_m), y_m + _LABEL_AT * (end_y_m - y_m)

    @cached_property
    def length_m(self) -> float:
        """Of a wall."""
        return _apart_m(self.start, self.end)


@dataclass(frozen=True)
class Change:
    """``object`` is new or gone since ``since_s``."""

    object: Object
    gone: bool
    since_s: float


@dataclass(frozen=True)
class _Known:
    object: Object
    first_s: float
    last_s: float


class Changes:
    """Follows the contours of a site. Times are those of one clock, in seconds."""

    def __init__(self) -> None:
        self._present: list[_Known] = []
        self._missing: list[_Known] = []
        self._contour: Contour | None = None
        self._settled_s: float | None = None

    def note(self, contour: Contour, now_s: float) -> None:
        """The newest contour; the same one again says that it stands."""
        if self._settled_s is None:
            if not contour.walls and not contour.cylinders:
                return
            self._settled_s = now_s + _SETTLES_S
        if contour is not self._contour:
            self._compare(list(_objects(contour))[:_MOST_OBJECTS], now_s)
            self._contour = contour
        self._present = [replace(known, last_s=now_s) for known in self._present]
        self._missing = [known for known in self._missing if now_s - known.last_s < SHOWN_S]

    def _compare(self, objects: Sequence[Object], now_s: float) -> None:
        """Each of ``objects`` is there since the first of those that it is the same as: walls merge and are split."""
        known = [*self._present, *self._missing]
        present, met = [], set[int]()
        for one in objects:
            same = [number for number, other in enumerate(known) if _is_same(other.object, one)]
            met.update(same)
            present.append(_Known(one, min((known[number].first_s for number in same), default=now_s), now_s))
        missing = [other for number, other in enumerate(known) if number not in met]
        self._present, self._missing = present, missing[: _MOST_OBJECTS - len(present)]

    def changes(self, now_s: float) -> list[Change]:
        """What is new or gone, the last of it first."""
        if self._settled_s is None:
            return []
        found = [
            change for known in (*self._present, *self._missing) if (change := self._change(known, now_s)) is not None
        ]
        return sorted(found, key=lambda change: -change.since_s)

    def _change(self, known: _Known, now_s: float) -> Change | None:
        assert self._settled_s is not None
        if now_s - known.last_s > _GONE_AFTER_S:
            stood = known.last_s > self._settled_s and known.last_s - known.first_s > _GONE_AFTER_S
            return Change(known.object, gone=True, since_s=known.last_s) if stood else None
        is_new = known.first_s > self._settled_s and now_s - known.first_s < SHOWN_S
        return Change(known.object, gone=False, since_s=known.first_s) if is_new else None


def _objects(contour: Contour) -> Iterator[Object]:
    for wall in contour.walls:
        yield Object("wall", (wall.start.x_m, wall.start.y_m), (wall.end.x_m, wall.end.y_m))
    for cylinder in contour.cylinders:
        place = cylinder.x_m, cylinder.y_m
        yield Object("cylinder", place, place, cylinder.radius_m)


def _is_same(one: Object, other: Object) -> bool:
    """Walls on one line that share a part of it, and cylinders at one place; a wall may have grown."""
    if one.kind != other.kind:
        return False
    if one.kind == "cylinder":
        return _apart_m(one.start, other.start) < max(_SAME_PLACE_M, min(one.radius_m, other.radius_m))
    length_m, other_m = one.length_m, other.length_m
    if not length_m or not other_m:
        return _apart_m(one.start, other.start) < _SAME_PLACE_M
    if _apart_m(one.middle, other.middle) > (length_m + other_m) / 2 + _SAME_PLACE_M:
        return False  # at once: most pairs of walls are far from each other
    along = ((one.end[0] - one.start[0]) / length_m, (one.end[1] - one.start[1]) / length_m)
    beside = ((other.end[0] - other.start[0]) / other_m, (other.end[1] - other.start[1]) / other_m)
    parallel = abs(along[0] * beside[0] + along[1] * beside[1])
    if degrees(acos(min(1.0, parallel))) > _SAME_DIRECTION_DEG:
        return False
    ways = [_way(one.start, along, end) for end in (other.start, other.end)]
    shares = min(length_m, max(forward for forward, _ in ways)) > max(0.0, min(forward for forward, _ in ways))
    return shares and abs(ways[0][1] + ways[1][1]) / 2 < _SAME_PLACE_M


def _way(start: Point, along: Point, place: Point) -> Point:
    """How far ``place`` lies from ``start`` along ``along`` and to its left."""
    x_m, y_m = place[0] - start[0], place[1] - start[1]
    return x_m * along[0] + y_m * along[1], y_m * along[0] - x_m * along[1]


def _apart_m(one: Point, other: Point) -> float:
    return hypot(one[0] - other[0], one[1] - other[1])


def outline_m(of: Object, corners: int = 32) -> list[Point]:
    """The wall's ends, or a ring of points."""
    if of.kind == "wall":
        return [of.start, of.end]
    turns = [2 * pi * number / corners for number in range(corners + 1)]
    return [(of.start[0] + of.radius_m * cos(turn), of.start[1] + of.radius_m * sin(turn)) for turn in turns]
