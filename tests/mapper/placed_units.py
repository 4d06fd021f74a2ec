"""Units that stand where a test says, with what they hear there."""

import math

import numpy as np
from mapper.fixed_units import survey_fixed
from mapper.room import Room

from noctule_mapper.config import MapperConfig
from noctule_mapper.placement.reflector_models import PlacedUnit
from noctule_mapper.placement.unit_views import UnitView, view_of

EXACTLY = np.zeros((3, 3))
ALL_AROUND_DEG = np.arange(-180.0, 180.0, 4.5)


def placed(room: Room, poses: np.ndarray, seed: int = 1) -> list[PlacedUnit]:
    """Units at their true poses, with what they hear there."""
    swept = [one.sweep for one in survey_fixed(room, poses, np.random.default_rng(seed))]
    units = []
    for number, pose in enumerate(poses, start=1):
        view = view_of(f"u{number}", [sweep for sweep in swept if sweep.unit == f"u{number}"], MapperConfig())
        assert view is not None
        units.append(PlacedUnit(view, pose, EXACTLY))
    return units


def view_with(ranges_m: dict[float, float], looks_deg: np.ndarray = ALL_AROUND_DEG) -> UnitView:
    """A unit that looked all around, if not told, and heard a reflector in each of the directions, in degrees."""
    direction_rad = np.radians(list(ranges_m))
    look_m = np.full(len(looks_deg), np.inf)
    for direction_deg, range_m in ranges_m.items():
        look_m[np.abs((looks_deg - direction_deg + 180) % 360 - 180) < 9] = range_m
    count = len(ranges_m)
    return UnitView(
        unit="u",
        direction_rad=direction_rad,
        direction_sigma_rad=np.full(count, math.radians(1)),
        range_m=np.array(list(ranges_m.values())),
        range_sigma_m=np.full(count, 0.005),
        look_rad=np.radians(looks_deg),
        look_m=look_m,
    )
