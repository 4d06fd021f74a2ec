"""What an operator reads of a unit's pose."""

from math import pi, radians

import pytest

from noctule import poses
from noctule.messages_pb2 import POSE_STATE_FITTED, POSE_STATE_OPEN, POSE_STATE_WRONG, Contour, Pose, UnitPose

HERE = Pose(x_m=1.0, y_m=2.0, heading_rad=pi, sigma_position_m=0.03, sigma_heading_rad=0.05)
UNKNOWN = Pose(sigma_position_m=100.0)
ERRORS = [1e-4, 0, 0, 0, 4e-4, 0, 0, 0, radians(0.5) ** 2]
WORDS = {
    "(1.02, 2.00) m, 179.0 deg, ±2.0 cm, ±0.5 deg, 2.0 cm and 1.0 deg from the stated pose": UnitPose(
        x_m=1.02, y_m=2.0, heading_rad=radians(179), stated=HERE, covariance=ERRORS, state=POSE_STATE_FITTED
    ),
    "WRONG POSE: the stated pose is off by 0.30 m and 20.0 deg; it seems to be at (1.30, 2.00) m": UnitPose(
        x_m=1.3, y_m=2.0, heading_rad=radians(200), stated=HERE, covariance=ERRORS, state=POSE_STATE_WRONG
    ),
    "as stated: the room cannot tell": UnitPose(
        x_m=1.0, y_m=2.0, heading_rad=pi, stated=HERE, covariance=ERRORS, state=POSE_STATE_OPEN
    ),
    "found at (1.00, 2.00) m, 180.0 deg, ±2.0 cm": UnitPose(
        x_m=1.0, y_m=2.0, heading_rad=pi, stated=UNKNOWN, covariance=ERRORS, state=POSE_STATE_FITTED
    ),
    "pose unknown, and the room cannot tell it": UnitPose(stated=UNKNOWN, state=POSE_STATE_OPEN),
}


@pytest.mark.parametrize(("said", "pose"), WORDS.items(), ids=WORDS.keys())
def test_a_pose_is_told_in_a_sentence(said: str, pose: UnitPose) -> None:
    assert said in poses.words(pose)


def test_only_a_unit_that_has_not_been_found_is_nowhere() -> None:
    assert [poses.is_placed(pose) for pose in WORDS.values()] == [True, True, True, True, False]


def test_a_pose_that_stands_as_stated_is_not_worth_a_line() -> None:
    still = UnitPose(x_m=1.005, y_m=2.0, heading_rad=-pi, stated=HERE, state=POSE_STATE_FITTED)  # the same half turn
    told = poses.remarkable(Contour(poses=[still, *WORDS.values()]))
    assert [said for said, pose in WORDS.items() if pose in told] == [said for said in WORDS if "as stated" not in said]
    assert still not in told
