"""What explains that marks are nearer or farther than they were: the unit's motion, or ranges that jumped as one.

From a unit that has moved by d, a reflector in the direction u is nearer by d . u; a corner or a post, which is a
point, is farther than that by (d x u)^2 / 2 r. Air that is warmer, or a sensor's clock that runs off, changes all
ranges by one share, a sensor that answers late by one length. A wardrobe or a door changes one mark or two.

The likelihood of a mark: a share of 0.15 is anywhere within 30 cm, since somebody moved something there, or it is no
longer seen from where the unit is now; the others err by what they scatter about what the explanation says. A jump
changes all ranges, so beside one only 0.02 are elsewhere: something would have to be moved in the same minute. An
explanation pays for what it could have explained else.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

from noctule_gateway.health.likelihood import Longer
from noctule_gateway.health.marks import Mark

_ELSEWHERE, _ELSEWHERE_AT_A_JUMP = 0.15, 0.02  # shares of the marks
_WITHIN_M = 0.6
_LEAST_ANGLE_RAD = math.radians(25.0)  # between two marks that determine a motion
_LEAST_SPREAD_RAD = math.radians(60.0)  # of the marks that a jump explains: a motion may do as much to fewer
_LEAST_MOVED_M, _MOST_MOVED_M = 0.025, 0.5
_LEAST_SHARE = 0.012  # of a range: 7 kelvin
_LEAST_SHARE_ASSUMED = 0.03  # 17 kelvin: where nobody measures the air's temperature, a heating does less
_MOST_SHARE = 0.12  # in air of -40 degrees C, told for 20, ranges are 11.8 % too long
_LEAST_M = 0.03
_MOTION_NATS, _JUMP_NATS, _AIR_NATS = 8.0, 4.0, 2.0  # two figures within 60 cm, one, and one that is small
_FITS = 3  # standard deviations of a mark
_LEAST_MARKS = 3


@dataclass(frozen=True)
class Shift:
    """An explanation: ``gain`` is in nats over a unit and a room at rest, ``longer`` by how much a range is longer,
    ``fitting`` the number of marks that it explains. ``moved_m`` is 0 where it is not a motion.
    """

    gain: float
    fitting: int
    longer: Longer
    moved_m: float
    words: str


def motion_of(marks: Sequence[Mark], air_measured: bool) -> Shift | None:
    """The likeliest motion; None with fewer than three marks, or where none is long enough."""
    rest, best = _rest(marks, air_measured), None
    for x_m, y_m in _motions(marks):
        moved_m, longer = math.hypot(x_m, y_m), _moved_by(x_m, y_m)
        if not _LEAST_MOVED_M <= moved_m <= _MOST_MOVED_M:
            continue
        off = [_off(one, longer, x_m, y_m) for one in marks]
        found = Shift(
            sum(map(_nats, marks, off)) - _MOTION_NATS - rest,
            sum(abs(each) <= _FITS for each in off),
            longer,
            moved_m,
            f"it was moved by {100 * moved_m:.0f} cm",
        )
        if best is None or found.gain > best.gain:
            best = found
    return None if best is None or best.fitting < _LEAST_MARKS else best


def jump_of(marks: Sequence[Mark], air_measured: bool) -> Shift | None:
    """The likeliest share or length by which all ranges are off; None where there is none."""
    rest, best = _rest(marks, air_measured), None
    for one in marks:
        share, length_m = one.longer_m / one.range_m, one.longer_m
        if _least_share(air_measured) <= abs(share) <= _MOST_SHARE:
            best = _better(best, marks, rest, _by_share(share), f"all ranges are {share:+.1%}")
        if abs(length_m) >= _LEAST_M:
            best = _better(best, marks, rest, _by_length(length_m), f"all ranges are {100 * length_m:+.0f} cm")
    return best


def as_far(marks: Sequence[Mark], air_measured: bool) -> bool:
    """Most marks are as far as they were, in air that may have become warmer: a turn changes no range."""
    most = _least_share(air_measured)
    return sum(abs(one.longer_m) <= _FITS * one.sigma_m + most * one.range_m for one in marks) * 2 >= len(marks)


def gain_of(jump: Shift, marks: Sequence[Mark], air_measured: bool) -> float:
    """What a jump that is known gains at these marks, in nats over a unit at rest."""
    return _jump_nats(marks, jump.longer) - _rest(marks, air_measured)


def _better(best: Shift | None, marks: Sequence[Mark], rest: float, longer: Longer, words: str) -> Shift | None:
    fitting = [one.direction_rad for one in marks if abs(_off(one, longer)) <= _FITS]
    if len(fitting) < _LEAST_MARKS or max(fitting) - min(fitting) < _LEAST_SPREAD_RAD:
        return best
    gain = _jump_nats(marks, longer) - rest
    return best if best is not None and best.gain >= gain else Shift(gain, len(fitting), longer, 0.0, words)


def _rest(marks: Sequence[Mark], air_measured: bool) -> float:
    """Log likelihood of the marks where nothing has changed but the air."""
    most = _least_share(air_measured)
    shares = [one.longer_m / one.range_m for one in marks]
    return max(
        sum(_nats(one, _off(one, _by_share(share))) for one in marks) - (_AIR_NATS if share else 0.0)
        for share in (0.0, *(each for each in shares if abs(each) < most))
    )


def _least_share(air_measured: bool) -> float:
    return _LEAST_SHARE if air_measured else _LEAST_SHARE_ASSUMED


def _motions(marks: Sequence[Mark]) -> Iterable[tuple[float, float]]:
    """What two marks tell, and what all the marks tell that fit it."""
    for one, other in combinations(marks, 2):
        solved = _solved([one, other])
        if solved is None:
            continue
        yield solved
        fitting = [each for each in marks if abs(_off(each, _moved_by(*solved), *solved)) <= 2 * _FITS]
        if len(fitting) > 2 and (refined := _solved(fitting)) is not None:
            yield refined


def _solved(marks: Sequence[Mark]) -> tuple[float, float] | None:
    """The motion of least squares; None where the marks lie in one direction."""
    towards = [(math.cos(one.direction_rad), math.sin(one.direction_rad), one.longer_m) for one in marks]
    a = sum(x * x for x, _, _ in towards)
    b = sum(x * y for x, y, _ in towards)
    d = sum(y * y for _, y, _ in towards)
    p = -sum(x * longer_m for x, _, longer_m in towards)
    q = -sum(y * longer_m for _, y, longer_m in towards)
    determinant = a * d - b * b
    if determinant < math.sin(_LEAST_ANGLE_RAD) ** 2:
        return None
    return (p * d - q * b) / determinant, (q * a - p * b) / determinant


def _moved_by(x_m: float, y_m: float) -> Longer:
    return lambda direction_rad, _range_m: -x_m * math.cos(direction_rad) - y_m * math.sin(direction_rad)


def _by_share(share: float) -> Longer:
    return lambda _direction_rad, range_m: share * range_m


def _by_length(length_m: float) -> Longer:
    return lambda _direction_rad, _range_m: length_m


def _off(mark: Mark, longer: Longer, x_m: float = 0.0, y_m: float = 0.0) -> float:
    """From what the explanation says of a wall, or of a point where that fits better; in standard deviations."""
    wall_m = mark.longer_m - longer(mark.direction_rad, mark.range_m)
    across_m = x_m * math.sin(mark.direction_rad) - y_m * math.cos(mark.direction_rad)
    return min(wall_m, wall_m - across_m**2 / (2 * mark.range_m), key=abs) / mark.sigma_m


def _jump_nats(marks: Sequence[Mark], longer: Longer) -> float:
    return sum(_nats(one, _off(one, longer), _ELSEWHERE_AT_A_JUMP) for one in marks) - _JUMP_NATS


def _nats(mark: Mark, off: float, elsewhere: float = _ELSEWHERE) -> float:
    """Log likelihood of a mark that is ``off`` by so many standard deviations, as a density by metre."""
    peak = (1 - elsewhere) / (mark.sigma_m * math.sqrt(2 * math.pi))
    return math.log(peak * math.exp(-(off**2) / 2) + elsewhere / _WITHIN_M)
