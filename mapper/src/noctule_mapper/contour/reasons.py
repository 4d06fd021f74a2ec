"""Why a contour has nothing, or no more: one plain line for the operator."""

from collections.abc import Sequence

import numpy as np

from noctule_mapper.config import GridConfig, LimitConfig, MapperConfig
from noctule_mapper.contour.contour import Contour
from noctule_mapper.readings.looks import is_fine
from noctule_mapper.readings.parts import stops_are_rare
from noctule_mapper.readings.sweep import SweepReadings


def reason(contour: Contour, heard_from_m: np.ndarray, sweeps: Sequence[SweepReadings], config: MapperConfig) -> str:
    """What the ``sweeps``, those of them that have echoes from ``heard_from_m`` (n, 2), lack for more than there is in
    ``contour``; "" where they lack nothing that a line could tell.
    """
    if not sweeps:
        return "no sweeps"
    if not len(heard_from_m):
        return _nothing_heard(sweeps)
    places = _places(heard_from_m, config.refinement.limits)
    heard = f"echoes from {places} place{'' if places == 1 else 's'}"
    if places < config.refinement.limits.least_places and not contour.cylinders:
        return f"{heard}; {_needed(contour, places, sweeps, config)}{_poses_alike(sweeps, places)}"
    if not (contour.walls or contour.cylinders):
        return f"{heard}, but no wall and no cylinder explains enough of them: add places, or check the poses"
    return ""


def no_room(off_grid: int, config: GridConfig) -> str:
    """That the grid has no room for so many sweeps; "" where it has."""
    if not off_grid:
        return ""
    count = f"{off_grid} sweep{'' if off_grid == 1 else 's'}"
    return (
        f"the grid has no room for the cells of {count} ([mapper.grid] most_tiles = {config.most_tiles}): check for "
        "poses far from the site, or map it as several sites"
    )


def _needed(contour: Contour, places: int, sweeps: Sequence[SweepReadings], config: MapperConfig) -> str:
    """How many places a wall, where there is none, and a cylinder need."""
    most = config.refinement.limits.least_places
    fine = any(is_fine(sweep) for sweep in sweeps)
    wall, wall_needs = f"a wall needs {most}", most
    if fine or stops_are_rare(sweeps, config.parts):
        wall, wall_needs = f"a wall needs {most - 1}", most - 1
    elif places == 1:
        wall += f" ({most - 1} if over {config.parts.reach_m / config.parts.steps:g} m apart)"
    two_may = f"; {most - 1} may do, best on opposite sides of it" if fine else ""
    if places < wall_needs and not contour.walls:
        return f"{wall}, a cylinder {most}{two_may}"
    return f"a cylinder needs {most}{two_may}"


def _nothing_heard(sweeps: Sequence[SweepReadings]) -> str:
    count = f"{len(sweeps)} sweep{'' if len(sweeps) == 1 else 's'}"
    if any(sweep.no_echo.any() for sweep in sweeps):
        return f"no echo anywhere in {count}"
    return f"no usable reading in {count}: see the states of the units"


def _places(at_m: np.ndarray, limits: LimitConfig) -> int:
    """How many places (n, 2) are: those nearer than ``same_place_m`` are one."""
    x, y = np.rint(at_m / limits.same_place_m).T
    return len(np.unique(x + 1j * y))


def _poses_alike(sweeps: Sequence[SweepReadings], places: int) -> str:
    """That several units stand at one place, which they can't."""
    units = {sweep.unit for sweep in sweeps}
    if places > 1 or len(units) == 1:
        return ""
    return f". {len(units)} units state the same pose: give each its own in the site file"
