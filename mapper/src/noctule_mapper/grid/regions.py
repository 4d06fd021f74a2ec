"""Where readings speak of the grid: the contact region about a contact, the free space before an arc."""

import math
from dataclasses import dataclass

import numpy as np

from noctule_mapper.config import GridConfig
from noctule_mapper.contacts.voting import Contacts
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.sweep import SweepReadings

# A cone and an arc are stroked cell by cell, so what a reading costs goes by the squares of these, whatever the cells'
# size: at 2 cm they are 41 m, more than a range can be, and 1 m, twice the widest sigma.
_FARTHEST_CELLS = 2046.0
_WIDEST_ARC_CELLS = 50.0
_HALF_DIAGONAL_CELLS = math.sqrt(0.5)


@dataclass(frozen=True)
class Arcs:
    """Contact regions, a line (n, 5) for each: x_m, y_m of the sensor, range_m, direction_rad of the contact, eps_m."""

    table: np.ndarray


@dataclass(frozen=True)
class Cones:
    """Free space before arcs, a line (n, 8) for each: column and row of the sensor's cell, axis_rad, the directions
    low_rad to high_rad that this beam speaks of, its reach in cells, its whole width_rad, and 1 where a sweep begins.
    The beams of a sweep follow one another and share no direction.
    """

    table: np.ndarray


def epsilon_m(sigma_m: np.ndarray | float, config: GridConfig) -> np.ndarray:
    """The paper's eps from the sensor's sigma; at least the way from a cell's centre to its corner, so that no arc
    slips between cells, and no more than a grid so fine can afford.
    """
    return bounded_epsilon_m(sigma_m, config.epsilon_sigmas, config.cell_m)


def bounded_epsilon_m(sigma_m: np.ndarray | float, sigmas: float, cell_m: float) -> np.ndarray:
    """The same; module ``geometry`` compiles it as it stands here."""
    return np.minimum(np.maximum(sigmas * sigma_m, cell_m * _HALF_DIAGONAL_CELLS), cell_m * _WIDEST_ARC_CELLS)


def contact_regions(echoes: Echoes, found: Contacts, config: GridConfig) -> Arcs:
    """Section III.C: the part of each arc within a central angle 6 eps / R about its contact.

    Echoes without a contact give nothing. A reading has one contact, so its evidence comes once per cell.
    """
    from noctule_mapper.grid.geometry import contact_arcs  # loads Numba, which only a grid should cost

    return Arcs(contact_arcs(*touched_by(echoes, found, config), cell_m=config.cell_m))


def touched_by(echoes: Echoes, found: Contacts, config: GridConfig) -> tuple[object, ...]:
    """The arguments of ``geometry.contact_arcs`` for the echoes."""
    at = echoes.x_m, echoes.y_m, echoes.range_m
    return found.kind, *at, found.direction_rad, echoes.sigma_m, config.epsilon_sigmas


def free_space(sweep: SweepReadings, config: GridConfig) -> Cones:
    """What lies inside the sweep's beams and before their arcs.

    Where beams overlap, the one whose axis is nearer speaks. The sensor is taken to be at the centre of its own cell.
    """
    from noctule_mapper.grid.geometry import beams  # loads Numba, which only a grid should cost

    return Cones(beams(*beams_of(sweep, config)))


def beams_of(sweep: SweepReadings, config: GridConfig) -> tuple[object, ...]:
    """The arguments of ``geometry.beams`` for the sweep."""
    pose = sweep.x_m, sweep.y_m, sweep.heading_rad
    readings = np.ascontiguousarray(sweep.bearing_rad, float), np.ascontiguousarray(sweep.range_m, float)
    sensor = sweep.beam_width_rad, sweep.range_sigma_m or 0.0
    return *pose, *readings, *sensor, config.epsilon_sigmas, config.cell_m, _FARTHEST_CELLS
