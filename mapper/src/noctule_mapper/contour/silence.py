"""Silence: what it costs to claim a reflector where somebody looked and heard nothing of it.

A look that should have heard a reflector, though nothing nearer answered and nothing stands before it, costs the
logarithm of the chance that the reflector stayed silent. Where nobody looked, nothing is known and nothing costs.
"""

from collections.abc import Sequence

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.likelihood import hidden, reach, shaded
from noctule_mapper.contour.reflectors import Circle, Crossing, Line, Reflector
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.evidence import Evidence

# Where in the lobe an answer is sure, in half beams: the lobe grows narrower with the range.
_SURE_RANGE_M = (0.5, 1.5, 4.0)
_SURE_HALF_BEAMS = (0.75, 0.6, 0.3)
_NEAREST_M = 0.03  # nearer, a sensor is deaf from its own ping
_FARTHEST_SHARE = 0.95  # of the span; about its end an echo is too weak


def silence_of(one: Reflector, data: Evidence, config: RefinementConfig, objects: Sequence[Reflector] = ()) -> float:
    """Price in nats of an object among others; a wall claims what has been seen of it, a point claims nothing.

    A wall's feet lie as far apart as its places; where all are in one spot, they are likelier a corner's.
    """
    if isinstance(one, Line):
        spread = min((one.high_m - one.low_m) / config.limits.short_wall_m, 1.0)
        close = 0.0 if data.looks is None else config.prices.close_feet_nats * (1 - spread)
        return close + silence_of_stretch(one, one.low_m, one.high_m, data, config, objects)
    return _price(one, data, config, objects, None) if isinstance(one, Circle) else 0.0


def silence_of_stretch(
    wall: Line, low_m: float, high_m: float, data: Evidence, config: RefinementConfig, objects: Sequence[Reflector] = ()
) -> float:
    """Price of a wall's going from ``low_m`` to ``high_m`` along itself."""
    if data.looks is None:
        return 0.0
    along = wall.along(data.looks.echoes)
    inside = (along > low_m + config.beam.behind_m) & (along < high_m - config.beam.behind_m)
    return _price(wall, data, config, objects, inside) if inside.any() else 0.0


def silence_of_corner(
    corner: Crossing, data: Evidence, config: RefinementConfig, objects: Sequence[Reflector] = ()
) -> float:
    """Price of a corner alone, whatever its walls are."""
    return _price(corner, data, config, objects, None)


def silence_of_link(
    corner: Crossing, data: Evidence, config: RefinementConfig, objects: Sequence[Reflector] = ()
) -> float:
    """Price of a corner: of the stretches that it adds to its walls, and of the corner itself."""
    first, second = corner.first, corner.second
    end_m, start_m = float(first.tangent @ corner.point), float(second.tangent @ corner.point)
    return (
        silence_of_stretch(first, first.high_m, end_m, data, config, objects)
        + silence_of_stretch(second, start_m, second.low_m, data, config, objects)
        + silence_of_corner(corner, data, config, objects)
    )


def _price(
    one: Reflector | Crossing,
    data: Evidence,
    config: RefinementConfig,
    objects: Sequence[Reflector],
    chosen: np.ndarray | None,
) -> float:
    """Sum over the looks, those ``chosen`` or all, in whose sight ``one`` is."""
    if data.looks is None:
        return 0.0
    all_looks = data.looks.echoes
    off_axis = np.abs(wrapped(one.directions(all_looks) - all_looks.axis_rad)) + all_looks.sigma_heading_rad
    towards = off_axis <= _SURE_HALF_BEAMS[0] * all_looks.half_beam_rad
    near = np.nonzero(towards if chosen is None else towards & chosen)[0]  # few of all: the rest is for these alone
    looks = all_looks.take(near)
    predicted_m = one.ranges(looks)
    sure = off_axis[near] <= looks.half_beam_rad * np.interp(predicted_m, _SURE_RANGE_M, _SURE_HALF_BEAMS)
    sure &= (predicted_m > _NEAREST_M) & (predicted_m < _FARTHEST_SHARE * data.span_m)
    sure &= looks.range_m > predicted_m + config.beam.gate_sigmas * data.looks.sigma_m[near] + config.beam.behind_m
    at = np.nonzero(sure)[0]
    if not len(at):
        return 0.0
    chance = reach(one, predicted_m[at], config)
    price = data.looks.weight[near[at]] * -np.log1p(-chance)
    return float(price @ _in_sight(one, objects, looks.take(at), config))


def _in_sight(
    one: Reflector | Crossing, objects: Sequence[Reflector], looks: Echoes, config: RefinementConfig
) -> np.ndarray:
    """Whether none of ``objects`` stands between each of ``looks`` and ``one``, bool (n,)."""
    own = (one.first, one.second) if isinstance(one, Crossing) else (one,)
    free = np.ones(len(looks), bool)
    for other in objects:
        if any(other is mine for mine in own):
            continue
        if isinstance(other, Line):
            free &= ~hidden(one, other, looks, looks.sigma_m, config)
        elif isinstance(other, Circle):
            free &= ~shaded(one, other, looks)
    return free
