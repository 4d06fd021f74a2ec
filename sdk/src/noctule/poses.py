"""What a contour says of its units' poses, in words and figures for people."""

from math import degrees, hypot, pi, remainder, sqrt

from noctule.bounds import UNKNOWN_SIGMA_POSITION_M
from noctule.messages_pb2 import POSE_STATE_OPEN, POSE_STATE_WRONG, Contour, Pose, UnitPose

_WORTH_TELLING_M, _WORTH_TELLING_DEG = 0.01, 1.0


def is_unknown(pose: Pose) -> bool:
    """Whether the pose says that it is unknown."""
    return pose.sigma_position_m >= UNKNOWN_SIGMA_POSITION_M


def is_placed(pose: UnitPose) -> bool:
    """Whether the contour knows where the unit is: only a unit whose stated pose is unknown may be nowhere."""
    return pose.state != POSE_STATE_OPEN or not is_unknown(pose.stated)


def moved(pose: UnitPose) -> tuple[float, float]:
    """How far the fit has it from the stated pose, in metres and degrees; both 0 where none was stated."""
    if is_unknown(pose.stated):
        return 0.0, 0.0
    turned_rad = remainder(pose.heading_rad - pose.stated.heading_rad, 2 * pi)
    return hypot(pose.x_m - pose.stated.x_m, pose.y_m - pose.stated.y_m), degrees(abs(turned_rad))


def sigmas(pose: UnitPose) -> tuple[float, float] | None:
    """The larger standard deviation along an axis in metres, and the heading's in degrees; None if not stated."""
    if len(pose.covariance) != 9:
        return None
    x, y, heading = (max(0.0, pose.covariance[4 * index]) for index in range(3))
    return sqrt(max(x, y)), degrees(sqrt(heading))


def words(pose: UnitPose) -> str:
    """The pose in a sentence, for the operator."""
    place = f"at ({pose.x_m:.2f}, {pose.y_m:.2f}) m, {degrees(remainder(pose.heading_rad, 2 * pi)):.1f} deg"
    away_m, turned_deg = moved(pose)
    if not is_placed(pose):
        return f"pose unknown{f': {pose.detail}' if pose.detail else ', and the room cannot tell it'}"
    if pose.state == POSE_STATE_WRONG:
        off = f"the stated pose is off by {away_m:.2f} m and {turned_deg:.1f} deg"
        return f"WRONG POSE: {off}; it seems to be {place}{f' ({pose.detail})' if pose.detail else ''}"
    if pose.state == POSE_STATE_OPEN:
        return f"{place}, as stated: the room cannot tell"
    known = sigmas(pose)
    error = f", ±{100 * known[0]:.1f} cm, ±{known[1]:.1f} deg" if known else ""
    if is_unknown(pose.stated):
        return f"found {place}{error}"
    return f"{place}{error}, {100 * away_m:.1f} cm and {turned_deg:.1f} deg from the stated pose"


def remarkable(contour: Contour) -> list[UnitPose]:
    """The poses that an operator should hear of: wrong, unknown or found ones, and those away from the stated pose."""
    return [pose for pose in contour.poses if _is_remarkable(pose)]


def _is_remarkable(pose: UnitPose) -> bool:
    away_m, turned_deg = moved(pose)
    said = pose.state == POSE_STATE_WRONG or is_unknown(pose.stated)
    return said or away_m >= _WORTH_TELLING_M or turned_deg >= _WORTH_TELLING_DEG
