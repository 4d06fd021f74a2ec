"""Exchanges: what else the echoes may be of than what greedy search has made of them.

Greedy search takes the best object first: a point may win the echoes of a cylinder or of a wall's end, and a wall
whose direction is not well known yet misses the corner that would fix it. So each object gives way to others of any
kind, and two walls are turned to meet in what has been heard of their corner. The caller fits and weighs them.
"""

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from noctule_mapper.config import MapperConfig
from noctule_mapper.contour.likelihood import gains
from noctule_mapper.contour.reflectors import Crossing, Line, Reflector, Spot
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.refinement.candidates import Candidates
from noctule_mapper.refinement.model_selection import covariance_of, finalists, fitted_alone

_LEAST_HOPE = 0.45  # of its price that a rough candidate must gain: its corners may pay for the rest
_BESIDE = 8.0  # a wall of two near feet knows no direction until it meets another
_ALIKE = 0.01  # metres or radians: another one so near is the same
_SIGMA_OF_A_BEAM = 0.6  # in half beams: of a direction that only the beam tells
_MOST_SQUARE = 16.0  # squared normalised error of what was heard of a corner, beyond what is usual


def others_for(
    old: Reflector | None,
    rest: Sequence[Reflector],
    unexplained: np.ndarray,
    library: Sequence[Candidates],
    data: Evidence,
    config: MapperConfig,
) -> Iterator[Reflector]:
    """What may take the place of ``old``, or stand beside all if there is none, fitted to the echoes ``unexplained``,
    bool (n,), by the ``rest`` of the objects.
    """
    its = unexplained if old is None else unexplained & (gains(old, data, config.refinement) > 0)
    for kind in library:
        for _, start in finalists(kind.touching(its), unexplained, data, config, _LEAST_HOPE):
            fitted = fitted_alone(start, unexplained, rest, data, config, _BESIDE)
            if fitted is None or (old is not None and _alike(fitted, old)):
                continue
            if (gains(fitted, data, config.refinement)[its] > 0).any():
                yield fitted


def _alike(one: Reflector, other: Reflector) -> bool:
    return type(one) is type(other) and bool(np.abs(one.parameters - other.parameters).max() < _ALIKE)


def met_walls(
    objects: Sequence[Reflector],
    chosen: Sequence[int],
    made: Sequence[np.ndarray],
    unexplained: np.ndarray,
    data: Evidence,
    config: MapperConfig,
) -> Iterator[list[Reflector]]:
    """The objects with two walls turned to meet where a point, which goes, or an echo that nothing explains was heard.

    One of the walls is among the ``chosen`` objects; ``made`` are the echoes of each object, bool (n,).
    """
    directed = np.isfinite(data.direction_sigma_rad) | (not data.has_fine)
    heard: list[tuple[int | None, np.ndarray]] = [
        (number, np.nonzero(made[number] & directed)[0]) for number, one in enumerate(objects) if isinstance(one, Spot)
    ]
    heard += [(None, np.array([number])) for number in np.nonzero(unexplained & directed)[0]]
    walls = {number: one for number, one in enumerate(objects) if isinstance(one, Line)}
    known = {number: covariance_of(one, data.take(np.nonzero(made[number])[0])) for number, one in walls.items()}
    for first, second in permutations(walls, 2):
        corner = Crossing(walls[first], walls[second])
        if first not in chosen and second not in chosen:
            continue
        if abs(corner.sine) < config.refinement.linking.least_crossing_sine:
            continue
        for point, echoes in heard:
            met = _turned_to_meet(corner, known[first], known[second], data.take(echoes), config)
            if met is not None:
                changed = {first: met.first, second: met.second}
                yield [changed.get(number, one) for number, one in enumerate(objects) if number != point]


def _turned_to_meet(
    corner: Crossing, first: np.ndarray, second: np.ndarray, heard: Evidence, config: MapperConfig
) -> Crossing | None:
    """The two walls, known to the covariances ``first`` and ``second``, after a Kalman step by what may have been
    ``heard`` of their corner; None where it was none of theirs.
    """
    echoes = heard.echoes
    off = np.concatenate([echoes.range_m - corner.ranges(echoes), wrapped(echoes.axis_rad - corner.directions(echoes))])
    slopes = np.concatenate([corner.slopes(echoes), corner.direction_slopes(echoes)])
    turn_sigma_rad = np.where(
        np.isfinite(heard.turn_sigma_rad), heard.turn_sigma_rad, _SIGMA_OF_A_BEAM * echoes.half_beam_rad
    )
    spread = np.concatenate([heard.sigma_m, np.hypot(turn_sigma_rad, corner.spread_rad)]) ** 2
    known = np.zeros((4, 4))
    known[:2, :2], known[2:, 2:] = first, second
    gain = known @ slopes.T @ np.linalg.inv(slopes @ known @ slopes.T + np.diag(spread))
    step = gain @ off
    left = off - slopes @ step
    if step @ np.linalg.solve(known, step) + left @ (left / spread) > _MOST_SQUARE + 2 * len(off):
        return None
    met = Crossing(corner.first.moved(step[:2]), corner.second.moved(step[2:]))
    slack_m = config.refinement.linking.overshoot_m
    end_m, start_m = float(met.first.tangent @ met.point), float(met.second.tangent @ met.point)
    return met if end_m > met.first.high_m - slack_m and start_m < met.second.low_m + slack_m else None
