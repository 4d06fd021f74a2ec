"""A contour as GeoJSON (RFC 7946): a feature for each wall, corner, cylinder, touch, closed outline and placed unit."""

import json
import math
from typing import Any

import numpy as np

from noctule import poses
from noctule.messages_pb2 import Contour, Corner, Cylinder, PoseState, Touch, UnitPose, Wall
from noctule_mapper.contour.outline import Outline
from noctule_mapper.export.shapes import circle_points, rings, signed_area_m2

FRAME = "metres in the site's own frame, not degrees of WGS 84"
CYLINDER_CORNERS = 64


def geojson(contour: Contour) -> bytes:
    """The contour as a FeatureCollection. RFC 7946 reads coordinates as degrees unless sender and receiver have agreed
    on something else: the foreign member "noctule" says that they are metres of the site.

    A feature's ``index`` counts its kind from 0, as ``walls`` of a corner or an outline do.
    """
    features = [
        *(_wall(index, wall) for index, wall in enumerate(contour.walls)),
        *(_corner(index, corner) for index, corner in enumerate(contour.corners)),
        *(_cylinder(index, cylinder) for index, cylinder in enumerate(contour.cylinders)),
        *(_touch(index, touch) for index, touch in enumerate(contour.touches)),
        *(_outline(index, outline) for index, outline in enumerate(rings(contour))),
        *(_unit(index, pose) for index, pose in enumerate(filter(poses.is_placed, contour.poses))),
    ]
    source = {
        "frame": FRAME,
        "site": contour.site,
        "method": contour.method,
        "sweeps": contour.sweeps,
        "time": contour.time.ToJsonString(),
    }
    collection = {"type": "FeatureCollection", "noctule": source, "features": features}
    return (json.dumps(collection, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


def _wall(index: int, wall: Wall) -> dict[str, Any]:
    ends = [[wall.start.x_m, wall.start.y_m], [wall.end.x_m, wall.end.y_m]]
    return _feature(
        "wall",
        index,
        {"type": "LineString", "coordinates": ends},
        theta_rad=wall.theta_rad,
        rho_m=wall.rho_m,
        length_m=math.dist(*ends),
        covariance=list(wall.covariance),
        readings=wall.readings,
        chance=wall.chance if wall.HasField("chance") else 1.0,
    )


def _corner(index: int, corner: Corner) -> dict[str, Any]:
    point = {"type": "Point", "coordinates": [corner.x_m, corner.y_m]}
    return _feature("corner", index, point, covariance=list(corner.covariance), walls=list(corner.walls))


def _cylinder(index: int, cylinder: Cylinder) -> dict[str, Any]:
    points = circle_points(cylinder.x_m, cylinder.y_m, cylinder.radius_m, CYLINDER_CORNERS)
    return _feature(
        "cylinder",
        index,
        _polygon(points),
        x_m=cylinder.x_m,
        y_m=cylinder.y_m,
        radius_m=cylinder.radius_m,
        covariance=list(cylinder.covariance),
        readings=cylinder.readings,
    )


def _touch(index: int, touch: Touch) -> dict[str, Any]:
    return _feature(
        "touch",
        index,
        {"type": "Point", "coordinates": [touch.x_m, touch.y_m]},
        covariance=list(touch.covariance),
        unit=touch.unit,
        readings=touch.readings,
        direction_rad=touch.direction_rad,
        width_rad=touch.width_rad,
        chance_wall=touch.chance_wall,
        chance_corner=touch.chance_corner,
        chance_cylinder=touch.chance_cylinder,
    )


def _outline(index: int, outline: Outline) -> dict[str, Any]:
    area_m2 = signed_area_m2(outline.points)
    points = outline.points if area_m2 > 0 else outline.points[::-1]  # RFC 7946, 3.1.6: anticlockwise
    return _feature("outline", index, _polygon(points), walls=list(outline.walls), area_m2=abs(area_m2))


def _unit(index: int, pose: UnitPose) -> dict[str, Any]:
    known = pose.state in PoseState.values()  # a newer mapper may have other states
    return _feature(
        "unit",
        index,
        {"type": "Point", "coordinates": [pose.x_m, pose.y_m]},
        unit=pose.unit,
        heading_rad=pose.heading_rad,
        covariance=list(pose.covariance),
        state=PoseState.Name(pose.state).removeprefix("POSE_STATE_").lower() if known else str(pose.state),
        fixes_frame=pose.fixes_frame,
    )


def _polygon(points: np.ndarray) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [[*points.tolist(), points[0].tolist()]]}


def _feature(kind: str, index: int, geometry: dict[str, Any], **properties: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "id": f"{kind}-{index}",
        "geometry": geometry,
        "properties": {"kind": kind, "index": index, **properties},
    }
