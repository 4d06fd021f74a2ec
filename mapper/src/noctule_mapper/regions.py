"""Which cells of the grid a reading speaks of: the contact region about its contact, the free space before its arc."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from noctule_mapper.config import GridConfig
from noctule_mapper.contacts import Contacts, Kind, wrapped
from noctule_mapper.echoes import Echoes
from noctule_mapper.grid import CellMasses
from noctule_mapper.sensor_model import arc_masses, free_mass
from noctule_mapper.sweep import SweepReadings


def epsilon_m(sigma_m: np.ndarray | float, config: GridConfig) -> np.ndarray:
    """The paper's eps from the sensor's sigma; at least the way from a cell's centre to its corner, lest an arc slip
    between cells.
    """
    return np.maximum(config.epsilon_sigmas * np.asarray(sigma_m), config.cell_m * np.sqrt(0.5))


def contact_regions(echoes: Echoes, found: Contacts, config: GridConfig) -> CellMasses:
    """Section III.C: the part of each arc within a central angle 6 eps / R about its contact, with Eq. 5-8 about that
    direction.

    Echoes without a contact give nothing. A reading has one contact, so its evidence comes once per cell.
    """
    touching = found.kind != Kind.NONE
    x, y, r, direction = (a[touching, None] for a in (echoes.x_m, echoes.y_m, echoes.range_m, found.direction_rad))
    if not len(r):
        return CellMasses(np.zeros((0, 2), int), np.zeros((0, 3)))
    eps = epsilon_m(echoes.sigma_m[touching, None], config)
    reach = int(np.ceil(_tip_m(r, eps).max() / config.cell_m)) + 1
    steps = np.arange(-reach, reach + 1)
    step_x, step_y = (a.ravel() for a in np.meshgrid(steps, steps))
    column = np.floor((x + r * np.cos(direction)) / config.cell_m).astype(int) + step_x
    row = np.floor((y + r * np.sin(direction)) / config.cell_m).astype(int) + step_y
    dx, dy = (column + 0.5) * config.cell_m - x, (row + 0.5) * config.cell_m - y
    angle = wrapped(np.arctan2(dy, dx) - direction)
    masses = arc_masses(np.hypot(dx, dy), angle, r, eps, 6 * eps / r)
    masses[..., :2] *= config.most_occupied
    masses[..., 2] = 1 - masses[..., 0] - masses[..., 1]
    spoken = masses[..., 2] < 1
    return CellMasses(np.stack([column[spoken], row[spoken]], axis=1), masses[spoken])


def _tip_m(range_m: np.ndarray, eps_m: np.ndarray) -> np.ndarray:
    """No point of a contact region is farther from its contact: by the law of cosines 3 eps / R round at R + eps, and
    never beyond the far side.
    """
    return np.minimum(eps_m * np.sqrt(10 + 9 * eps_m / range_m), 2 * range_m + eps_m)


def free_space(sweep: SweepReadings, config: GridConfig) -> tuple[np.ndarray, np.ndarray]:
    """Cells, int (n, 2), that lie before an arc of the sweep, and the belief that each is free, (n,); a cell comes
    once.

    Where beams overlap, the one whose axis is nearer speaks. The sensor is taken to be at the centre of its own cell.
    """
    heard = np.isfinite(sweep.range_m)
    order = np.argsort(wrapped(sweep.direction_rad[heard]))
    axes, ranges = wrapped(sweep.direction_rad[heard])[order], sweep.range_m[heard][order]
    eps = epsilon_m(sweep.range_sigma_m or 0.0, config)
    cells, beliefs = [np.zeros((0, 2), int)], [np.zeros(0)]
    gaps = np.diff(axes, append=axes[:1] + 2 * np.pi)
    for axis, range_m, before, after in zip(axes, ranges, np.roll(gaps, 1) / 2, gaps / 2, strict=True):
        half = sweep.beam_width_rad / 2
        disc = _disc(_DISC_STEP * int(range_m / config.cell_m / _DISC_STEP + 1))
        sector = _between(disc.direction_rad, axis - min(half, before), axis + min(half, after))
        distance_m = disc.distance[sector] * config.cell_m
        belief = config.most_free * free_mass(
            distance_m, wrapped(disc.direction_rad[sector] - axis), range_m, eps, sweep.beam_width_rad
        )
        cells.append(disc.cells[sector][belief > 0])
        beliefs.append(belief[belief > 0])
    own = np.floor(np.array([sweep.x_m, sweep.y_m]) / config.cell_m).astype(int)
    return np.concatenate(cells) + own, np.concatenate(beliefs)


_DISC_STEP = 25  # cells; discs of few sizes serve all ranges


@dataclass(frozen=True)
class _Disc:
    """The cells about a sensor, in the order of their directions: numbers (n, 2), distance in cells (n,), direction
    (n,).
    """

    cells: np.ndarray
    distance: np.ndarray
    direction_rad: np.ndarray


@lru_cache(maxsize=16)
def _disc(reach: int) -> _Disc:
    row, column = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1)
    inside = column**2 + row**2 <= reach**2
    column, row = column[inside], row[inside]
    direction = np.arctan2(row, column)
    order = np.argsort(direction)
    return _Disc(np.stack([column, row], axis=1)[order], np.hypot(column, row)[order], direction[order])


def _between(sorted_rad: np.ndarray, low_rad: float, high_rad: float) -> np.ndarray:
    """Numbers of the directions, sorted within -pi to pi, that lie from low up to below high, round the circle."""
    turns = [
        np.arange(*np.searchsorted(sorted_rad, [low_rad + turn, high_rad + turn]))
        for turn in (-2 * np.pi, 0, 2 * np.pi)
    ]
    return np.concatenate(turns)
