"""Turning: the two senses in which a unit turns differ by its gears' play, and its own plateaus tell by how much.

Sweeps alternate: a unit takes its bearings anticlockwise, then clockwise. Where its play is not calibrated, what one
sense hears at a bearing the other hears some degrees beside it. A reflector that answers both senses shows the offset;
each sense is corrected by half of it, for nothing tells which is right.
"""

from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.readings.plateaus import of_fine_sweeps, plateaus

_MOST_OFFSET_RAD = np.radians(8)  # a motor's gears have less play
_USUAL_OFFSET_RAD = np.radians(2)  # spread of the offset before anything is heard
_SAME_RANGE_SIGMAS = 4.0
_OUTLIER_SIGMAS = 2.5  # of the median: a plateau that only one sense heard whole


@dataclass(frozen=True)
class Offset:
    """By how much a bearing is larger when it is reached anticlockwise, and the standard deviation of that."""

    offset_rad: float
    sigma_rad: float


_UNKNOWN = Offset(0.0, float(_USUAL_OFFSET_RAD))


def reconciled(data: Evidence, config: RefinementConfig) -> Evidence:
    """The evidence with the bearings of both senses, and of the looks, corrected by half of each unit's offset."""
    fine = of_fine_sweeps(data)
    for unit in np.unique(data.echoes.unit[fine & (data.echoes.sense != 0)]):
        found = offset_of(data.take(fine & (data.echoes.unit == unit)), config)
        data = replace(data, echoes=_corrected(data.echoes, unit, found))
        if data.looks is not None:
            data = replace(data, looks=replace(data.looks, echoes=_corrected(data.looks.echoes, unit, found)))
    return data


def offset_of(data: Evidence, config: RefinementConfig) -> Offset:
    """The offset that the echoes of one unit's fine sweeps show."""
    anticlockwise, clockwise = (data.take(data.echoes.sense == sense) for sense in (1, -1))
    if not len(anticlockwise.echoes) or not len(clockwise.echoes):
        return _UNKNOWN
    first, second = plateaus(anticlockwise, config), plateaus(clockwise, config)
    off_m = np.abs(first.echoes.range_m[:, None] - second.echoes.range_m[None, :])
    sigma_m = np.hypot(first.range_sigma_m[:, None], second.range_sigma_m[None, :])
    turned_rad = wrapped(first.echoes.axis_rad[:, None] - second.echoes.axis_rad[None, :])
    alike = (off_m < _SAME_RANGE_SIGMAS * sigma_m) & (np.abs(turned_rad) < _MOST_OFFSET_RAD)
    alike &= first.place[:, None] == second.place[None, :]
    # A plateau with two likes tells nothing: the senses may have heard different ones.
    one, other = np.nonzero(alike & (alike.sum(axis=1, keepdims=True) == 1) & (alike.sum(axis=0, keepdims=True) == 1))
    if not len(one):
        return _UNKNOWN
    offset_rad = turned_rad[one, other]
    sigma_rad = np.hypot(first.direction_sigma_rad[one], second.direction_sigma_rad[other])
    kept = np.abs(offset_rad - np.median(offset_rad)) <= _OUTLIER_SIGMAS * sigma_rad
    information = (1 / sigma_rad[kept] ** 2).sum()
    known = information + 1 / _USUAL_OFFSET_RAD**2
    return Offset(float((offset_rad[kept] / sigma_rad[kept] ** 2).sum() / known), float(1 / np.sqrt(known)))


def _corrected(echoes: Echoes, unit: int, found: Offset) -> Echoes:
    turned_rad = np.where(echoes.unit == unit, echoes.sense * found.offset_rad / 2, 0.0)
    return replace(echoes, axis_rad=echoes.axis_rad - turned_rad)
