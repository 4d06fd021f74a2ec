"""The estimate as messages: Contour, Features and GridTile."""

import math
from typing import TYPE_CHECKING

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp

from noctule import messages_pb2
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.contour.contour import Contour, PoseState, Touch, UnitPose, Wall

if TYPE_CHECKING:  # a fit by the default method has neither
    from noctule_mapper.grid.grid import GridTile
    from noctule_mapper.paper.features import FeaturePoints

_KINDS = {
    Kind.WALL: messages_pb2.CONTACT_KIND_WALL,
    Kind.CYLINDER: messages_pb2.CONTACT_KIND_CYLINDER,
    Kind.CORNER: messages_pb2.CONTACT_KIND_CORNER,
}
_POSE_STATES = {
    PoseState.FITTED: messages_pb2.POSE_STATE_FITTED,
    PoseState.OPEN: messages_pb2.POSE_STATE_OPEN,
    PoseState.WRONG: messages_pb2.POSE_STATE_WRONG,
}


def contour_message(contour: Contour, site: str, mapper: str = "") -> messages_pb2.Contour:
    """``contour`` as the message that goes on the bus and into files."""
    return messages_pb2.Contour(
        site=site,
        mapper=mapper,
        time=timestamp(contour.time_s),
        method=contour.method,
        sweeps=contour.sweeps,
        note=contour.note,
        walls=[_wall(wall) for wall in contour.walls],
        corners=[
            messages_pb2.Corner(
                x_m=corner.x_m, y_m=corner.y_m, covariance=corner.covariance.ravel(), walls=corner.walls
            )
            for corner in contour.corners
        ],
        cylinders=[
            messages_pb2.Cylinder(
                x_m=cylinder.x_m,
                y_m=cylinder.y_m,
                radius_m=cylinder.radius_m,
                covariance=cylinder.covariance.ravel(),
                readings=cylinder.readings,
            )
            for cylinder in contour.cylinders
        ],
        touches=[_touch(touch) for touch in contour.touches],
        poses=[_unit_pose(pose) for pose in contour.poses],
        stops=[_unit_pose(pose) for pose in contour.stops],
    )


def _wall(wall: Wall) -> messages_pb2.Wall:
    """``wall`` with theta in 0 to pi, as in the paper's Table I; on which side the room is, start and end tell."""
    turns = math.floor(wall.theta_rad / math.pi)
    sign = -1 if turns % 2 else 1
    mirror = np.array([[1, sign], [sign, 1]])
    return messages_pb2.Wall(
        theta_rad=wall.theta_rad - turns * math.pi,
        rho_m=sign * wall.rho_m,
        start=messages_pb2.Point(x_m=wall.start[0], y_m=wall.start[1]),
        end=messages_pb2.Point(x_m=wall.end[0], y_m=wall.end[1]),
        covariance=(mirror * wall.covariance).ravel(),
        readings=wall.readings,
        chance=wall.chance if wall.chance < 1 else None,
    )


def _touch(touch: Touch) -> messages_pb2.Touch:
    return messages_pb2.Touch(
        x_m=touch.x_m,
        y_m=touch.y_m,
        covariance=touch.covariance.ravel(),
        unit=touch.unit,
        readings=touch.readings,
        direction_rad=math.remainder(touch.direction_rad, 2 * math.pi),
        width_rad=touch.width_rad,
        chance_wall=touch.chance_wall,
        chance_corner=touch.chance_corner,
        chance_cylinder=touch.chance_cylinder,
    )


def _unit_pose(pose: UnitPose) -> messages_pb2.UnitPose:
    return messages_pb2.UnitPose(
        unit=pose.unit,
        x_m=pose.x_m,
        y_m=pose.y_m,
        heading_rad=pose.heading_rad,
        covariance=pose.covariance.ravel(),
        stated=messages_pb2.Pose(
            x_m=pose.stated_x_m,
            y_m=pose.stated_y_m,
            heading_rad=pose.stated_heading_rad,
            sigma_position_m=pose.stated_sigma_position_m,
            sigma_heading_rad=pose.stated_sigma_heading_rad,
        ),
        state=_POSE_STATES[pose.state],
        fixes_frame=pose.fixes_frame,
        detail=pose.detail,
    )


def features_message(
    points: "FeaturePoints", site: str, mapper: str = "", time_s: float = 0.0
) -> messages_pb2.Features:
    """Feature points as the message that goes on the bus."""
    return messages_pb2.Features(
        site=site,
        mapper=mapper,
        time=timestamp(time_s),
        points=[
            messages_pb2.FeaturePoint(x_m=x, y_m=y, reliability=reliability, kind=_KINDS[Kind(kind)])
            for x, y, reliability, kind in zip(points.x_m, points.y_m, points.reliability, points.kind, strict=True)
        ],
    )


def tile_message(tile: "GridTile", site: str, mapper: str = "", time_s: float = 0.0) -> messages_pb2.GridTile:
    """A tile of the reliability grid as the message that goes on the bus, beliefs in 1/255."""
    rows, columns = tile.occupied.shape
    return messages_pb2.GridTile(
        site=site,
        mapper=mapper,
        time=timestamp(time_s),
        tile_x=tile.tile_x,
        tile_y=tile.tile_y,
        x_m=tile.x_m,
        y_m=tile.y_m,
        cell_m=tile.cell_m,
        columns=columns,
        rows=rows,
        occupied=_bytes(tile.occupied),
        free=_bytes(tile.free),
    )


def timestamp(time_s: float) -> Timestamp:
    """Seconds since 1970 UTC as a Timestamp."""
    stamp = Timestamp()
    stamp.FromNanoseconds(round(time_s * 1e9))
    return stamp


def _bytes(belief: np.ndarray) -> bytes:
    return np.rint(np.clip(belief, 0, 1) * 255).astype(np.uint8).tobytes()
