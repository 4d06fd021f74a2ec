"""The echoes as evidence: with their spread, with the places that share an error, weighed against "from anywhere"."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.readings import arrays
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.looks import Looks
from noctule_mapper.readings.stands import Stands, moved, stands_of


@dataclass(frozen=True)
class Evidence:
    """The echoes of a refinement; arrays (n,)."""

    echoes: Echoes
    range_sigma_m: np.ndarray  # of a range from a place that is exactly known
    place: np.ndarray  # a number that the echoes from one place share
    span_m: float = field(metadata=arrays.SHARED)  # ranges that an echo of nothing may have
    direction_sigma_rad: np.ndarray  # of the axis as a direction from the unit; infinite where only the beam tells it
    stand: np.ndarray  # a number that the echoes of one stand share
    lone_nats: np.ndarray  # log of the chance that no object of the map made it; 0 where nothing tells
    stands: Stands = field(metadata=arrays.SHARED)
    looks: Looks | None = field(default=None, metadata=arrays.SHARED)  # what fine sweeps say of where nothing was heard
    look_stand: np.ndarray | None = field(default=None, metadata=arrays.SHARED)  # the stand of each look

    take = arrays.take

    @cached_property
    def sigma_m(self) -> np.ndarray:
        """Of a range, the errors that it shares with others in it, (n,)."""
        return np.hypot(self.range_sigma_m, self.echoes.shared_sigma_m)

    @cached_property
    def own_sigma_m(self) -> np.ndarray:
        """Of a range of a fine sweep beside the others from there, (n,): the fit will find what they have wrong
        together, so that is no reason to think less of an echo that obeys. Of a coarse sweep, as ``sigma_m``.
        """
        return np.where(self.echoes.is_fine, self.range_sigma_m, self.sigma_m)

    @cached_property
    def turn_sigma_rad(self) -> np.ndarray:
        """Of an axis as a direction, the heading's error in it, (n,)."""
        return np.hypot(self.direction_sigma_rad, self.echoes.sigma_heading_rad)

    @cached_property
    def _most_gain(self) -> np.ndarray:
        """Gain in nats of a residual of nothing, (n,)."""
        return np.log(self.span_m / (self.own_sigma_m * np.sqrt(2 * np.pi))) - self.lone_nats

    @cached_property
    def tells_direction(self) -> np.ndarray | None:
        """Which axes are directions from the unit, bool (n,); None where only beams tell any."""
        known = np.isfinite(self.direction_sigma_rad)
        return known if known.any() else None

    @cached_property
    def has_fine(self) -> bool:
        """Whether any of the echoes is of a fine sweep."""
        return bool(self.echoes.is_fine.any())

    def respread(self, factor: np.ndarray | float) -> "Evidence":
        """The same with ``factor`` times the spread of ranges."""
        return replace(self, range_sigma_m=factor * self.range_sigma_m)

    def gain(self, residual_m: np.ndarray, at: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Gain in nats of residuals (..., m) of the echoes ``at`` (all of them if not told); negative where the outlier
        model explains an echo better.
        """
        return self._most_gain[at] - 0.5 * (residual_m / self.sigma_m[at]) ** 2

    def direction_gain(self, direction_rad: np.ndarray, at: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Gain in nats of the directions of the echoes ``at``, if their reflectors lie in ``direction_rad`` (..., m),
        over any direction; 0 where only the beam tells it. A few are far off: a neighbour's plateau ran into theirs.
        """
        if self.tells_direction is None:
            return np.zeros_like(direction_rad)
        known = self.tells_direction[at]
        sigma_rad, own_rad = (np.where(known, of[at], 1.0) for of in (self.turn_sigma_rad, self.direction_sigma_rad))
        square = (wrapped(direction_rad - self.echoes.axis_rad[at]) / sigma_rad) ** 2
        shape = _SHARP_SHARE * np.exp(-0.5 * square) + (1 - _SHARP_SHARE) / _BLUNT * np.exp(-0.5 * square / _BLUNT**2)
        return np.where(known, np.log(np.sqrt(2 * np.pi) / own_rad * np.maximum(shape, _LEAST_SHAPE)), 0.0)


_SHARP_SHARE, _BLUNT = 0.85, 3.0  # the others' directions err so many times as far
_LEAST_SHAPE = 1e-12


def direction_weight(normalised: np.ndarray) -> np.ndarray:
    """How much directions tell, (n,), that are so many sigmas off: 1 if they err as stated, a ninth if they are surely
    among the few that err three times as far. By expectation and maximisation of direction_gain()'s mixture.
    """
    odds_nats = 0.5 * normalised**2 * (1 - 1 / _BLUNT**2) + np.log((1 / _SHARP_SHARE - 1) / _BLUNT)
    is_blunt = 1 / (1 + np.exp(-np.minimum(odds_nats, _MOST_ODDS_NATS)))
    return 1 - is_blunt + is_blunt / _BLUNT**2


_MOST_ODDS_NATS = 50.0


def evidence(
    echoes: Echoes, sigma_m: np.ndarray, span_m: float, config: RefinementConfig, looks: Looks | None = None
) -> Evidence:
    """Evidence of ``echoes`` whose ranges have the spread ``sigma_m``, (n,), in a span of ``span_m``, and of looks."""
    cell = np.rint(np.stack([echoes.x_m, echoes.y_m], axis=1) / config.limits.same_place_m).astype(int)
    _, place = np.unique(cell, axis=0, return_inverse=True)
    stands, stand = stands_of(arrays.join([echoes, looks.echoes]) if looks is not None else echoes)
    of_echo, of_look = np.split(stand, [len(echoes)])
    anywhere = np.full(len(echoes), np.inf)
    return Evidence(
        echoes, sigma_m, place.ravel(), span_m, anywhere, of_echo, np.zeros(len(echoes)), stands, looks, of_look
    )


def joined(first: Evidence, second: Evidence) -> Evidence:
    """Both, one after the other; their places are numbered alike, and the looks are those of the first."""
    return arrays.join([first, second])


def with_stands(data: Evidence, stands: Stands) -> Evidence:
    """The evidence, its looks too, with the poses and the sensors of ``stands``."""
    echoes, looks = moved(data.echoes, data.stand, data.stands, stands), data.looks
    if looks is not None and data.look_stand is not None:
        looks = replace(looks, echoes=moved(looks.echoes, data.look_stand, data.stands, stands))
    return replace(data, echoes=echoes, stands=stands, looks=looks)


def newest_of_each_beam(data: Evidence) -> np.ndarray:
    """Numbers of the echoes that stand for all when objects are weighed: of one place and direction the newest of those
    on which most of its sweeps agree.

    Such echoes share their errors: of pose, of clutter, of what passes by. A thousand of them prove no more than one.
    """
    group, agreeing = _beam_and_agreeing(data)
    best = np.lexsort((np.arange(len(group)), agreeing, group))
    last = np.append(np.diff(group[best]) != 0, True)[: len(group)]
    return np.sort(best[last])


def agreeing(data: Evidence) -> np.ndarray:
    """How many of the echoes of its place and direction, itself among them, have the range of each echo, (n,)."""
    return _beam_and_agreeing(data)[1]


def _beam_and_agreeing(data: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """A number that the echoes of one place and direction share, and how many of them agree with each, (n,) each."""
    beam = np.rint(data.echoes.axis_rad % (2 * np.pi) / data.echoes.half_beam_rad).astype(int)
    _, group = np.unique(np.stack([data.place, beam], axis=1), axis=0, return_inverse=True)
    order = np.lexsort((data.echoes.range_m, group.ravel()))
    parted = np.diff(group.ravel()[order]) != 0
    parted |= np.diff(data.echoes.range_m[order]) > _AGREEING_SIGMAS * np.sqrt(2) * data.range_sigma_m[order[1:]]
    level = np.zeros(len(order), int)
    level[order] = np.concatenate([[0], np.cumsum(parted)])[: len(order)]
    return group.ravel(), np.bincount(level)[level] if len(level) else level


_AGREEING_SIGMAS = 3.0
