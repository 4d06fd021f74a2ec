"""Where a sweep was made."""

from math import pi

import pytest

from noctule.messages_pb2 import Pose
from noctule.site import FixedPose, Pose2, PoseKey, UnknownPose, WaypointPath
from noctule_gateway.pose import PoseTrack, pose_of_sweep

HERE = Pose2(1.0, 2.0, 0.5, sigma_position_m=0.004, sigma_heading_rad=0.006)
THERE = Pose2(3.0, 2.0, 0.5)


def tracked(*poses: tuple[float, Pose]) -> PoseTrack:
    track = PoseTrack()
    for time_s, pose in poses:
        track.add(time_s, pose)
    return track


def test_a_fixed_unit_is_where_the_site_file_says_with_its_sigmas() -> None:
    pose = pose_of_sweep(FixedPose(HERE), None, 0.0, PoseTrack())
    assert pose == Pose(x_m=1.0, y_m=2.0, heading_rad=0.5, sigma_position_m=0.004, sigma_heading_rad=0.006)


def test_a_unit_to_be_found_has_a_pose_that_says_so_and_is_not_one_without_a_pose() -> None:
    pose = pose_of_sweep(UnknownPose(), None, 0.0, PoseTrack())
    assert pose is not None
    assert pose.sigma_position_m == 100.0  # noctule.proto, Pose: the most, which says that the pose is unknown


@pytest.mark.parametrize(("waypoint", "x_m"), [(0, 1.0), (1, 3.0), (2, None), (None, None)])
def test_a_waypoint_indexes_the_path_and_no_other_has_a_pose(waypoint: int | None, x_m: float | None) -> None:
    pose = pose_of_sweep(WaypointPath((HERE, THERE)), waypoint, 0.0, PoseTrack())
    assert (pose and pose.x_m) == x_m


def test_a_tracked_unit_is_between_the_two_poses_around_the_sweep() -> None:
    track = tracked(
        (10.0, Pose(x_m=0.0, y_m=1.0, heading_rad=pi - 0.1, sigma_position_m=0.01)),
        (12.0, Pose(x_m=2.0, y_m=3.0, heading_rad=-pi + 0.3, sigma_position_m=0.02)),
    )
    pose = pose_of_sweep(PoseKey(), None, 10.5, track)
    assert pose is not None
    assert (pose.x_m, pose.y_m) == (0.5, 1.5)
    assert pose.heading_rad == pytest.approx(pi)  # the short way round, 0.4 rad in all
    assert pose.sigma_position_m == 0.02


def test_a_tracked_unit_is_at_its_last_pose_and_nowhere_before_its_first() -> None:
    track = tracked((10.0, Pose(x_m=1.0)), (11.0, Pose(x_m=2.0)))
    assert pose_of_sweep(PoseKey(), None, 9.9, track) is None
    assert pose_of_sweep(PoseKey(), None, 60.0, track) == Pose(x_m=2.0)


def test_a_pose_that_is_late_is_refused_and_counted() -> None:
    track = tracked((10.0, Pose(x_m=1.0)), (9.5, Pose(x_m=2.0)))
    assert track.refused == 1
    assert track.at(11.0) == Pose(x_m=1.0)


def test_a_tracker_whose_clock_was_set_back_is_believed_again_at_once() -> None:
    track = tracked((3600.0, Pose(x_m=1.0)), (10.0, Pose(x_m=2.0)), (11.0, Pose(x_m=3.0)))
    assert track.refused == 0
    assert track.at(10.5) == Pose(x_m=2.5)
