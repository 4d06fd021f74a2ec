"""Where a unit was when a sweep began: a fixed pose, the waypoint of a path, or what a tracker publishes."""

from bisect import bisect_right
from collections import deque
from math import pi, remainder
from typing import assert_never

from noctule.messages_pb2 import Pose
from noctule.site import FixedPose, PoseKey, PoseSource, UnknownPose, WaypointPath

_KEPT = 4096  # more than a minute of poses at 50 Hz
_SET_BACK_S = 1.0  # a pose that is older than the last by more than this has a clock behind it that was set back


class PoseTrack:
    """The poses that a tracker published lately, in the order of time. ``refused`` counts those of no use.

    All times are the host's monotonic seconds: in UTC, a pose that came before the host's clock was set back would be
    one of the future, and no sweep's.
    """

    def __init__(self) -> None:
        self.refused = 0
        self._poses: deque[tuple[float, Pose]] = deque(maxlen=_KEPT)

    def add(self, time_s: float, pose: Pose) -> None:
        """Take in where the unit was at ``time_s``, unless that is not after the last.

        Where the tracker's clock was set back, what it told before is forgotten.
        """
        if self._poses and time_s < self._poses[-1][0] - _SET_BACK_S:
            self._poses.clear()
        if not self._poses or time_s > self._poses[-1][0]:
            self._poses.append((time_s, pose))
        else:
            self.refused += 1

    def at(self, time_s: float) -> Pose | None:
        """The pose at ``time_s``: between the two around it, else the last before it; None before the first."""
        poses = tuple(self._poses)  # the tracker's thread may add meanwhile
        after = bisect_right(poses, time_s, key=lambda entry: entry[0])
        if after == 0:
            return None
        if after == len(poses):
            return poses[-1][1]
        return _between(*poses[after - 1], *poses[after], time_s)


def pose_of_sweep(source: PoseSource, waypoint: int | None, time_s: float, track: PoseTrack) -> Pose | None:
    """The pose of a sweep that began at ``time_s`` (host's monotonic) with the unit at ``waypoint``; None where nobody
    has said it.

    A unit whose pose is to be found has one that says so.
    """
    match source:
        case FixedPose(pose):
            return pose.message()
        case UnknownPose():
            return source.message()
        case WaypointPath(poses):
            return poses[waypoint].message() if waypoint is not None and waypoint < len(poses) else None
        case PoseKey():
            return track.at(time_s)
    assert_never(source)


def _between(before_s: float, before: Pose, after_s: float, after: Pose, time_s: float) -> Pose:
    share = (time_s - before_s) / (after_s - before_s)
    turn_rad = remainder(after.heading_rad - before.heading_rad, 2 * pi)  # the short way round
    return Pose(
        x_m=before.x_m + share * (after.x_m - before.x_m),
        y_m=before.y_m + share * (after.y_m - before.y_m),
        heading_rad=remainder(before.heading_rad + share * turn_rad, 2 * pi),
        sigma_position_m=max(before.sigma_position_m, after.sigma_position_m),
        sigma_heading_rad=max(before.sigma_heading_rad, after.sigma_heading_rad),
    )
