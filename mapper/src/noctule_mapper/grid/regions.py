"""Where readings speak of the grid: the contact region about a contact, the free space before an arc."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from noctule_mapper.config import GridConfig
from noctule_mapper.contacts.voting import Contacts, Kind
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.sweep import SweepReadings

# A cone and an arc are stroked cell by cell, so what a reading costs goes by the squares of these, whatever the cells'
# size: at 2 cm they are 41 m, more than a range can be, and 1 m, twice the widest sigma.
_FARTHEST_CELLS = 2046.0
_WIDEST_ARC_CELLS = 50.0


@dataclass(frozen=True)
class Arcs:
    """Contact regions, a line (n, 5) for each: x_m, y_m of the sensor, range_m, direction_rad of the contact, eps_m."""

    table: np.ndarray


class Cones(NamedTuple):
    """Free space before arcs: the sensor's cell, int (n, 2), and (n, 5): axis_rad, the directions low_rad to high_rad
    that this beam speaks of, its reach in cells and its whole width_rad.
    """

    apex: np.ndarray
    beam: np.ndarray


def epsilon_m(sigma_m: np.ndarray | float, config: GridConfig) -> np.ndarray:
    """The paper's eps from the sensor's sigma; at least the way from a cell's centre to its corner, lest an arc slip
    between cells, and no more than a grid so fine can afford.
    """
    least_m, most_m = config.cell_m * np.sqrt(0.5), config.cell_m * _WIDEST_ARC_CELLS
    return np.clip(config.epsilon_sigmas * np.asarray(sigma_m), least_m, most_m)


def contact_regions(echoes: Echoes, found: Contacts, config: GridConfig) -> Arcs:
    """Section III.C: the part of each arc within a central angle 6 eps / R about its contact.

    Echoes without a contact give nothing. A reading has one contact, so its evidence comes once per cell.
    """
    touching = found.kind != Kind.NONE
    columns = (echoes.x_m, echoes.y_m, echoes.range_m, found.direction_rad, epsilon_m(echoes.sigma_m, config))
    return Arcs(np.stack([column[touching] for column in columns], axis=1))


def free_space(sweep: SweepReadings, config: GridConfig) -> Cones:
    """What lies inside the sweep's beams and before their arcs.

    Where beams overlap, the one whose axis is nearer speaks. The sensor is taken to be at the centre of its own cell.
    """
    heard = np.isfinite(sweep.range_m)
    axis = sweep.direction_rad[heard] % (2 * np.pi)
    order = np.argsort(axis)
    axis, reach_m = axis[order], sweep.range_m[heard][order] - epsilon_m(sweep.range_sigma_m or 0.0, config)
    gap = np.minimum(np.diff(axis, append=axis[:1] + 2 * np.pi), sweep.beam_width_rad)
    beam = np.empty((len(axis), 5))
    beam[:, 0], beam[:, 1], beam[:, 2] = axis, axis - np.roll(gap, 1) / 2, axis + gap / 2
    beam[:, 3], beam[:, 4] = np.clip(reach_m / config.cell_m, 0, _FARTHEST_CELLS), sweep.beam_width_rad
    apex = np.array([math.floor(sweep.x_m / config.cell_m), math.floor(sweep.y_m / config.cell_m)])
    return Cones(np.repeat(apex[None], len(axis), axis=0), beam)
