"""How a contour compares with the room it was heard in."""

import numpy as np
from mapper.room import Room

from noctule_mapper.estimate import Contour

NEAR_M = 0.05  # farther from any true corner, wall or cylinder, an object is an invented one


def corner_errors_m(contour: Contour, room: Room) -> np.ndarray:
    """Distance from each true corner to the nearest found, (n,), infinite where none was found."""
    found = np.array([(corner.x_m, corner.y_m) for corner in contour.corners]).reshape(-1, 2)
    away = np.hypot(*(found[None] - room.vertices[:, None]).transpose(2, 0, 1))
    return away.min(axis=1, initial=np.inf)


def invented(contour: Contour, room: Room) -> list[str]:
    """What of the contour is not in the room, a phrase for each."""
    corners = [
        f"corner at ({one.x_m:.2f}, {one.y_m:.2f})"
        for one in contour.corners
        if np.hypot(*(room.vertices - (one.x_m, one.y_m)).T).min() > NEAR_M
    ]
    walls = [
        f"wall from ({wall.start[0]:.2f}, {wall.start[1]:.2f}) to ({wall.end[0]:.2f}, {wall.end[1]:.2f})"
        for wall in contour.walls
        if _off_walls_m((np.array(wall.start) + wall.end) / 2, room) > NEAR_M
    ]
    cylinders = [
        f"cylinder at ({one.x_m:.2f}, {one.y_m:.2f})"
        for one in contour.cylinders
        if min((np.hypot(one.x_m - x, one.y_m - y) for x, y, _ in room.cylinders), default=np.inf) > NEAR_M
    ]
    return corners + walls + cylinders


def _off_walls_m(point: np.ndarray, room: Room) -> float:
    side = room.ends - room.vertices
    share = np.clip(((point - room.vertices) * side).sum(axis=1) / (side**2).sum(axis=1), 0, 1)
    return float(np.hypot(*(room.vertices + share[:, None] * side - point).T).min())
