"""Stops: a unit that is carried from place to place has a pose at each of them, the last of which is where it is."""

from collections.abc import Iterable

from noctule_mapper.contour.contour import UnitPose
from noctule_mapper.readings.looks import Pose, pose_of
from noctule_mapper.readings.sweep import SweepReadings

_DIGITS = 6  # of metres and radians, to which a stated pose is the same


def parted(
    poses: Iterable[UnitPose], sweeps: Iterable[SweepReadings]
) -> tuple[tuple[UnitPose, ...], tuple[UnitPose, ...]]:
    """Of each unit the pose where it stands now, by unit, and those where it stood before, in the order in which it
    last left them; ``sweeps`` as they came.
    """
    newest = {_rounded(pose_of(sweep)): number for number, sweep in enumerate(sweeps)}
    in_order = sorted(poses, key=lambda pose: newest.get(_stated(pose), -1))
    now = {pose.unit: pose for pose in in_order}
    before = tuple(pose for pose in in_order if now[pose.unit] is not pose)
    return tuple(now[unit] for unit in sorted(now)), before


def _stated(pose: UnitPose) -> Pose:
    return _rounded((pose.unit, pose.stated_x_m, pose.stated_y_m, pose.stated_heading_rad))


def _rounded(pose: Pose) -> Pose:
    unit, x_m, y_m, heading_rad = pose
    return unit, round(x_m, _DIGITS), round(y_m, _DIGITS), round(heading_rad, _DIGITS)
