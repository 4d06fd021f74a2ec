"""Right angles: which plateaus of one place are walls of one right-angled frame, and which the corners between them.

One place alone cannot tell a wall from a corner or a post. But a frame at any turn predicts where its walls' normals
point, and a right-angled corner answers at the root of the sum of the squares of its walls' distances, in the direction
that they imply. How much likelier a frame makes what was heard than so many plateaus from anywhere is its evidence.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from noctule_mapper.readings.angles import wrapped

SIDES = 4
_MOST_OPTIONS = 4  # that one side of a frame may be, the likeliest first
_GATE_SIGMAS = 4.0
_WIDEST_GATE_RAD = np.radians(12)
_NO_PLATEAU = -1
_SHARP_SHARE, _BLUNT = 0.85, 3.0  # of directions; the others err so many times as far
_OTHERS = 1.5  # plateaus that a room with a frame has beside it: posts, edges, what is false
_LEAST_COUNT = 4  # of plateaus from anywhere, among which a coincidence is sought


@dataclass(frozen=True)
class Heard:
    """What one place heard, arrays (n,): plateaus, and before them the walls that are ``known`` by other places."""

    direction_rad: np.ndarray
    direction_sigma_rad: np.ndarray
    range_m: np.ndarray
    range_sigma_m: np.ndarray
    known: np.ndarray
    span_m: float  # of the ranges that an echo from anywhere may have


@dataclass(frozen=True)
class Frame:
    """A right-angled frame about one place: side k's outward normal points to turn_rad + k pi / 2.

    ``walls`` (4,) numbers the plateau of each side, ``corners`` (4,) that of the corner from side k to the next, -1
    where there is none; ``distance_m`` (4,) is NaN where a side is unknown. ``nats`` is its evidence.
    """

    turn_rad: float
    walls: tuple[int, ...]
    corners: tuple[int, ...]
    distance_m: np.ndarray
    nats: float


@dataclass(frozen=True)
class _Option:
    """A side's distance, by a plateau of its own, or by that of a corner where the side itself is not heard."""

    distance_m: float
    sigma_m: float
    wall: int = _NO_PLATEAU
    corner: int = _NO_PLATEAU


_NOTHING = _Option(np.nan, np.nan)


def frames(heard: Heard, against: Callable[[Frame], float]) -> list[Frame]:
    """Every frame that explains two plateaus or more, or one beside known walls; ``against`` is what else speaks
    against a frame, in nats.
    """
    found = []
    for seed in range(len(heard.direction_rad)):
        for sides in product(*_options(heard, seed)):
            frame = _frame(heard, sides)
            if frame is not None:
                found.append(Frame(**{**vars(frame), "nats": frame.nats - against(frame)}))
    return found


def _options(heard: Heard, seed: int) -> list[list[_Option]]:
    """What each side may be, if plateau ``seed`` is the first side: of a frame's walls it has the least number."""
    own = _Option(float(heard.range_m[seed]), float(heard.range_sigma_m[seed]), wall=seed)
    options = [[own]]
    for side in range(1, SIDES):
        off_rad = np.abs(wrapped(heard.direction_rad - heard.direction_rad[seed] - side * np.pi / 2))
        near = _gate(heard, seed, off_rad) & (np.arange(len(off_rad)) > seed)
        walls = sorted(np.nonzero(near)[0], key=lambda number: off_rad[number])
        seen = [_Option(float(heard.range_m[one]), float(heard.range_sigma_m[one]), wall=int(one)) for one in walls]
        unseen = [] if side == SIDES // 2 else _by_corners(heard, seed, 1 if side == 1 else -1)
        options.append([_NOTHING, *(seen + unseen)[:_MOST_OPTIONS]])
    return options


def _by_corners(heard: Heard, seed: int, sense: int) -> list[_Option]:
    """The side next to ``seed`` anticlockwise (1) or clockwise (-1), by plateaus that may be their corner."""
    near_m = heard.range_m[seed]
    beyond = (heard.range_m > near_m) & ~heard.known
    distance_m = np.sqrt(np.where(beyond, heard.range_m**2 - near_m**2, 1.0))
    off_rad = wrapped(heard.direction_rad - heard.direction_rad[seed] - sense * np.arctan2(distance_m, near_m))
    fits = beyond & _gate(heard, seed, np.abs(off_rad))
    sigma_m = np.hypot(heard.range_m * heard.range_sigma_m, near_m * heard.range_sigma_m[seed]) / distance_m
    return [_Option(float(distance_m[one]), float(sigma_m[one]), corner=int(one)) for one in np.nonzero(fits)[0]]


def _gate(heard: Heard, seed: int, off_rad: np.ndarray) -> np.ndarray:
    sigma_rad = np.hypot(heard.direction_sigma_rad, heard.direction_sigma_rad[seed])
    return off_rad < np.minimum(_GATE_SIGMAS * sigma_rad, _WIDEST_GATE_RAD)


def _frame(heard: Heard, sides: Sequence[_Option]) -> Frame | None:
    """The frame with these sides, and the corners that fit it; None where it explains too little or one plateau
    twice.
    """
    walls = tuple(side.wall for side in sides)
    turn_rad = _mean(heard, [(wall, side * np.pi / 2) for side, wall in enumerate(walls) if wall >= 0])[0]
    corners, range_nats = _corners(heard, sides, turn_rad)
    claims = [(wall, side * np.pi / 2) for side, wall in enumerate(walls) if wall >= 0]
    claims += [
        (corner, side * np.pi / 2 + np.arctan2(sides[(side + 1) % SIDES].distance_m, sides[side].distance_m))
        for side, corner in enumerate(corners)
        if corner >= 0
    ]
    numbers = [number for number, _ in claims]
    own = [number for number in numbers if not heard.known[number]]
    anchored = len(own) < len(numbers)
    if len(set(numbers)) < len(numbers) or len(own) < 2 - anchored:
        return None
    turn_rad, nats = _mean(heard, claims)
    nats -= _mean(heard, [claim for claim in claims if heard.known[claim[0]]])[1]
    plateaus = int((~heard.known).sum())
    count = max(_LEAST_COUNT, plateaus)
    nats += range_nats - (len(own) - (not anchored)) * np.log(count)
    if not anchored:
        nats += plateaus - _OTHERS + (plateaus - len(own)) * np.log(_OTHERS / count)
    return Frame(turn_rad, walls, corners, np.array([side.distance_m for side in sides]), nats)


def _corners(heard: Heard, sides: Sequence[_Option], turn_rad: float) -> tuple[tuple[int, ...], float]:
    """The plateau of each corner, and what their ranges say for the frame, in nats."""
    corners, total = [_NO_PLATEAU] * SIDES, 0.0
    taken = {side.wall for side in sides}
    for side in range(SIDES):
        first, second = sides[side], sides[(side + 1) % SIDES]
        by = first.corner if side == SIDES - 1 else second.corner if side == 0 else _NO_PLATEAU
        if by >= 0:
            corners[side] = by  # the side's distance came of it: its range says nothing more
            total += np.log(heard.range_m[by] / (second if side == 0 else first).distance_m)
    for side in range(SIDES):
        first, second = sides[side], sides[(side + 1) % SIDES]
        range_m = np.hypot(first.distance_m, second.distance_m)
        if corners[side] >= 0 or not range_m < heard.span_m:
            continue
        share = np.array([first.distance_m * first.sigma_m, second.distance_m * second.sigma_m]) / range_m
        sigma_m = np.sqrt(heard.range_sigma_m**2 + (share**2).sum())
        off = (heard.range_m - range_m) / sigma_m
        towards_rad = turn_rad + side * np.pi / 2 + np.arctan2(second.distance_m, first.distance_m)
        turned = wrapped(heard.direction_rad - towards_rad) / heard.direction_sigma_rad
        fits = (np.abs(off) < _GATE_SIGMAS) & (np.abs(turned) < _GATE_SIGMAS) & ~heard.known
        fits[[number for number in taken.union(corners) if number >= 0]] = False
        if fits.any():
            best = int(np.where(fits, off**2 + turned**2, np.inf).argmin())
            corners[side] = best
            total += np.log(heard.span_m / (np.sqrt(2 * np.pi) * sigma_m[best])) - off[best] ** 2 / 2
    return tuple(corners), float(total)


def _mean(heard: Heard, claims: Sequence[tuple[int, float]]) -> tuple[float, float]:
    """The turn on which the directions of ``claims`` (plateau, its direction in the frame) agree, and how much likelier
    that makes them than any directions, the turn itself being unknown, in nats.
    """
    if not claims:
        return 0.0, 0.0
    number, offset_rad = np.array([one for one, _ in claims]), np.array([angle for _, angle in claims])
    sigma_rad, first_rad = heard.direction_sigma_rad[number], heard.direction_rad[number[0]] - offset_rad[0]
    turned_rad = wrapped(heard.direction_rad[number] - offset_rad - first_rad)
    weight, sharp, blunt = 1 / sigma_rad**2, np.zeros(0), np.zeros(0)
    for _ in range(2):
        mean_rad = float(weight @ turned_rad / weight.sum())
        square = ((turned_rad - mean_rad) / sigma_rad) ** 2
        sharp, blunt = _SHARP_SHARE * np.exp(-square / 2), (1 - _SHARP_SHARE) / _BLUNT * np.exp(-square / 2 / _BLUNT**2)
        weight = (sharp + blunt / _BLUNT**2) / (sharp + blunt) / sigma_rad**2
    nats = np.log(np.sqrt(2 * np.pi) / sigma_rad * (sharp + blunt)).sum()
    return first_rad + mean_rad, float(nats + np.log(1 / np.sqrt(weight.sum() * 2 * np.pi)))


def weights(found: Sequence[Frame], prior_nats: float) -> np.ndarray:
    """The chance of each frame, (frames,), against there being none."""
    nats = np.array([frame.nats for frame in found]) - prior_nats
    most = max(0.0, float(nats.max(initial=0.0)))
    likelihood = np.exp(nats - most)
    return likelihood / (likelihood.sum() + np.exp(-most))


def claimed(found: Sequence[Frame], chance: np.ndarray, count: int) -> Iterator[np.ndarray]:
    """The chance that each of ``count`` plateaus is a wall, then a corner, of a frame; (count,) each."""
    for of in ("walls", "corners"):
        total = np.zeros(count)
        for frame, share in zip(found, chance, strict=True):
            for number in getattr(frame, of):
                if number >= 0:
                    total[number] += share
        yield total
