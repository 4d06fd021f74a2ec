"""Sweeps of units whose poses are unknown: kept aside until their units are found, so that no fit sees a wild pose."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from noctule.bounds import UNKNOWN_SIGMA_POSITION_M
from noctule_mapper.config import MapperConfig
from noctule_mapper.contour.contour import PoseState, UnitPose
from noctule_mapper.placement.reflector_models import PlacedUnit
from noctule_mapper.placement.unit_views import view_of
from noctule_mapper.readings.looks import is_fine
from noctule_mapper.readings.sweep import SweepReadings

if TYPE_CHECKING:  # what seeks poses is loaded when one is sought
    from noctule_mapper.placement.unknown_poses import FoundPose

_MOST_KNOWN_SIGMA_M = 0.2  # a worse stated pose tells others nothing
_TELLING_SWEEPS = 4  # of a unit: more tell the same again, and fewer are worth no search each
# A found pose enters the fit as if stated, but the fit hears the same echoes once more: with so many times its error
# they count by a quarter too much.
_AS_STATED = 2.0
_COARSE = "its sweeps are too coarse: it must sweep by steps of half a beam or less (4.5 degrees, say)"


class Unplaced:
    """The sweeps of units whose poses are unknown, and what has been found of these."""

    def __init__(self) -> None:
        self._sweeps: dict[tuple[str, int], SweepReadings] = {}  # as they came
        self._found: dict[str, FoundPose] = {}
        self._why: dict[str, str] = {}
        self._sought_with: frozenset[tuple[object, ...]] = frozenset()

    def take(self, sweep: SweepReadings) -> SweepReadings | None:
        """Take a sweep whose pose is unknown; the sweep with its unit's pose if that has been found."""
        self._sweeps[sweep.identity] = sweep
        return self._at_found(sweep)

    def drop(self, identity: tuple[str, int]) -> None:
        """Forget a sweep, and with its unit's last one where that was."""
        gone = self._sweeps.pop(identity, None)
        if gone is not None and all(sweep.unit != gone.unit for sweep in self._sweeps.values()):
            self._found.pop(gone.unit, None)
            self._why.pop(gone.unit, None)

    def as_it_came(self, sweep: SweepReadings) -> SweepReadings:
        """The sweep as it was before its pose was found."""
        return self._sweeps.get(sweep.identity, sweep)

    def waiting(self) -> list[SweepReadings]:
        """The sweeps of units that have not been found."""
        return [sweep for sweep in self._sweeps.values() if sweep.unit not in self._found]

    def seek(self, placed: Sequence[SweepReadings], config: MapperConfig) -> list[SweepReadings]:
        """Look for the units that wait, if there is more to go by than the last time; the sweeps of those that have now
        been found, with their poses.
        """
        waiting = _by_unit(self.waiting())
        if not waiting:
            return []
        by_stand = _by_stand(placed)
        heard_by = {("waits", unit, len(own) < _TELLING_SWEEPS) for unit, own in waiting.items()}
        heard_by |= {(*stand, len(own) < _TELLING_SWEEPS) for stand, own in by_stand.items()}
        if heard_by == self._sought_with:
            return []
        from noctule_mapper.placement.unknown_poses import find_poses

        self._sought_with = frozenset(heard_by)
        known = [one for own in enumerate(by_stand.values()) if (one := _placed(*own, config)) is not None]
        views = {unit: view_of(unit, own, config) for unit, own in waiting.items()}
        found, left_open = find_poses(known, [view for view in views.values() if view is not None])
        self._why = {unit: _COARSE for unit, view in views.items() if view is None}
        self._why |= {one.unit: one.why for one in left_open}
        self._found |= {one.unit: one for one in found}
        names = {one.unit for one in found}
        return [
            at for own in waiting.values() for sweep in own if sweep.unit in names and (at := self._at_found(sweep))
        ]

    def published(self, fitted: Iterable[UnitPose]) -> tuple[UnitPose, ...]:
        """The contour's poses: those of units that were found as not stated, and those that are still sought."""
        poses = {one.unit: one for one in fitted}
        for unit, found in self._found.items():
            poses[unit] = _unstated(_found(poses[unit]) if unit in poses else _found_pose(found))
        for unit in {sweep.unit for sweep in self.waiting()}:
            poses[unit] = _unstated(replace(_NOWHERE, unit=unit, detail=self._why.get(unit, "")))
        return tuple(poses[unit] for unit in sorted(poses))

    def _at_found(self, sweep: SweepReadings) -> SweepReadings | None:
        found = self._found.get(sweep.unit)
        if found is None:
            return None
        x_m, y_m, heading_rad = (float(each) for each in found.pose)
        variance = found.covariance
        return replace(
            sweep,
            x_m=x_m,
            y_m=y_m,
            heading_rad=heading_rad,
            sigma_position_m=_AS_STATED * float(np.sqrt(np.linalg.eigvalsh(variance[:2, :2])[-1])),
            sigma_heading_rad=_AS_STATED * float(np.sqrt(variance[2, 2])),
        )


_UNKNOWN_M = UNKNOWN_SIGMA_POSITION_M
_UNKNOWN = np.diag([_UNKNOWN_M**2, _UNKNOWN_M**2, np.pi**2])


_NOWHERE = UnitPose("", 0.0, 0.0, 0.0, _UNKNOWN, 0.0, 0.0, 0.0, _UNKNOWN_M, np.pi, PoseState.OPEN)


def _found_pose(found: "FoundPose") -> UnitPose:
    x_m, y_m, heading_rad = (float(each) for each in found.pose)
    return replace(
        _NOWHERE,
        unit=found.unit,
        x_m=x_m,
        y_m=y_m,
        heading_rad=heading_rad,
        covariance=found.covariance,
        state=PoseState.FITTED,
    )


def _found(pose: UnitPose) -> UnitPose:
    """The fitted pose of a unit that was found: where the fit tells less, it stands as found, which is not open."""
    return replace(pose, state=PoseState.FITTED) if pose.state is PoseState.OPEN else pose


def _unstated(pose: UnitPose) -> UnitPose:
    """The pose as one that nobody has stated, whatever the fit began with."""
    return replace(
        pose,
        stated_x_m=0.0,
        stated_y_m=0.0,
        stated_heading_rad=0.0,
        stated_sigma_position_m=_UNKNOWN_M,
        stated_sigma_heading_rad=np.pi,
    )


def _by_unit(sweeps: Iterable[SweepReadings]) -> dict[str, list[SweepReadings]]:
    by_unit: dict[str, list[SweepReadings]] = {}
    for sweep in sweeps:
        by_unit.setdefault(sweep.unit, []).append(sweep)
    return by_unit


def _by_stand(sweeps: Iterable[SweepReadings]) -> dict[tuple[object, ...], list[SweepReadings]]:
    """The fine sweeps from poses that are known, by unit and pose."""
    by_stand: dict[tuple[object, ...], list[SweepReadings]] = {}
    for sweep in sweeps:
        if is_fine(sweep) and sweep.sigma_position_m < _MOST_KNOWN_SIGMA_M:
            by_stand.setdefault((sweep.unit, sweep.x_m, sweep.y_m, sweep.heading_rad), []).append(sweep)
    return by_stand


def _placed(stand: int, sweeps: Sequence[SweepReadings], config: MapperConfig) -> PlacedUnit | None:
    """The unit as it stands there: another than itself at other stands, or than the one of it that is sought."""
    first = sweeps[0]
    view = view_of(f"{first.unit} at stand {stand}", sweeps, config)
    if view is None:
        return None
    sigmas = [first.sigma_position_m, first.sigma_position_m, first.sigma_heading_rad]
    return PlacedUnit(view, np.array([first.x_m, first.y_m, first.heading_rad]), np.diag(np.square(sigmas)))
