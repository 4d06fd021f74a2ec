"""Why a contour has nothing, or no more: one plain line for the operator."""

from collections.abc import Sequence

import numpy as np

from noctule_mapper.config import LimitConfig
from noctule_mapper.contour.contour import Contour
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.looks import is_fine
from noctule_mapper.readings.sweep import SweepReadings


def reason(contour: Contour, echoes: Echoes, sweeps: Sequence[SweepReadings], limits: LimitConfig) -> str:
    """What the ``sweeps`` and their ``echoes`` lack for more than there is in ``contour``; "" where they lack nothing
    that a line could tell.
    """
    if not sweeps:
        return "no sweeps"
    if not len(echoes):
        return _nothing_heard(sweeps)
    places, empty = _places(echoes, limits), not (contour.walls or contour.cylinders)
    wall_needs = limits.least_places - any(is_fine(sweep) for sweep in sweeps)
    if places < wall_needs and not contour.walls:
        needs = f"a wall needs {wall_needs}, a cylinder {limits.least_places}"
        return f"{_from(places)}; {needs}{_poses_alike(sweeps, places)}"
    if places < limits.least_places:
        return f"{_from(places)}; a cylinder needs {limits.least_places}{_poses_alike(sweeps, places)}"
    if empty:
        return f"{_from(places)}, but no wall and no cylinder explains enough of them: check the poses"
    return ""


def _from(places: int) -> str:
    return f"echoes from {places} place{'' if places == 1 else 's'}"


def _nothing_heard(sweeps: Sequence[SweepReadings]) -> str:
    count = f"{len(sweeps)} sweep{'' if len(sweeps) == 1 else 's'}"
    if any(sweep.no_echo.any() for sweep in sweeps):
        return f"no echo anywhere in {count}"
    return f"no usable reading in {count}: see the states of the units"


def _places(echoes: Echoes, limits: LimitConfig) -> int:
    """How many places the echoes are from: those nearer than ``same_place_m`` are one."""
    cells = np.rint(np.stack([echoes.x_m, echoes.y_m], axis=1) / limits.same_place_m)
    return len(np.unique(cells, axis=0))


def _poses_alike(sweeps: Sequence[SweepReadings], places: int) -> str:
    """That several units stand at one place, which they can't."""
    units = {sweep.unit for sweep in sweeps}
    if places > 1 or len(units) == 1:
        return ""
    return f". {len(units)} units state the same pose: give each its own in the site file"
