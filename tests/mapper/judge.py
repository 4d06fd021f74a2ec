"""How a contour compares with the room it was heard in, and with the fit that is told every label."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mapper.label_fit import LabelFit, label_fit, on_time, variances, wall_lines
from mapper.room import LabelledSweep, Room, distance_to_sides_m

from noctule_mapper.contour.contour import Contour, Cylinder, Wall

NEAR_M = 0.05  # farther from any true corner, wall or cylinder, an object is an invented one
LEAST_PLACES = 5  # from which both walls of a corner answered, for it to be due
RADIUS_SIGMAS = 4.0  # of the label-knowing fit that a radius must have, for a cylinder to be due


@dataclass(frozen=True)
class Errors:
    """Of the same true things, (n,) each, in metres: the mapper's error, that of the fit that is told every label, that
    of one that is told also which echoes were a cycle late, and the standard deviation that the former has for it.
    """

    mapper_m: np.ndarray
    label_fit_m: np.ndarray
    on_time_m: np.ndarray
    sigma_m: np.ndarray


@dataclass(frozen=True)
class Verdict:
    """A contour judged. Errors are of what was due and found; a phrase tells each thing missed or false; squared
    normalised errors are chi-square with 2 degrees of freedom for walls and corners and 3 for cylinders.
    """

    corners: Errors
    centres: Errors
    radii: Errors
    missed: tuple[str, ...]
    false: tuple[str, ...]
    wall_squares: tuple[float, ...]
    corner_squares: tuple[float, ...]
    cylinder_squares: tuple[float, ...]


def judge(contour: Contour, room: Room, surveyed: Sequence[LabelledSweep]) -> Verdict:
    """What the contour of ``surveyed`` is worth, by ``room``, in which it was made."""
    told, told_late = label_fit(room, surveyed), label_fit(room, on_time(surveyed))
    due, errors_m = _corners_due(room, surveyed), corner_errors_m(contour, room)
    hit = due & (errors_m <= NEAR_M)
    found = {i: _same_cylinder(contour, room, i) for i in _cylinders_due(told)}
    met = [i for i, one in found.items() if one is not None]
    ours = np.array([(one.x_m, one.y_m, one.radius_m) for one in found.values() if one is not None]).reshape(-1, 3)
    true = np.array(room.cylinders).reshape(-1, 3)[met]
    spread = variances(told.cylinder_covariances)[met]
    off, told_off, late_off = (circles - true for circles in (ours, told.cylinders[met], told_late.cylinders[met]))
    return Verdict(
        corners=Errors(
            mapper_m=errors_m[hit],
            label_fit_m=_lengths_m(told.corners - room.vertices)[hit],
            on_time_m=_lengths_m(told_late.corners - room.vertices)[hit],
            sigma_m=np.sqrt(variances(told.corner_covariances)[hit].sum(axis=1)),
        ),
        centres=Errors(_lengths_m(off), _lengths_m(told_off), _lengths_m(late_off), np.sqrt(spread[:, :2].sum(axis=1))),
        radii=Errors(np.abs(off[:, 2]), np.abs(told_off[:, 2]), np.abs(late_off[:, 2]), np.sqrt(spread[:, 2])),
        missed=_missed(room, due & ~hit, [i for i in found if i not in met]),
        false=false_objects(contour, room),
        wall_squares=wall_squares(contour, room),
        corner_squares=corner_squares(contour, room),
        cylinder_squares=cylinder_squares(contour, room),
    )


def false_objects(contour: Contour, room: Room, cylinders_near_m: Sequence[float] | None = None) -> tuple[str, ...]:
    """A phrase for each wall whose two ends are not near one true wall, each corner that is not near a true one, each
    cylinder that is not near a true one in centre and radius, to within NEAR_M or as said of each true one.
    """
    near_m = cylinders_near_m or [NEAR_M] * len(room.cylinders)
    walls = [
        f"wall from ({wall.start[0]:.2f}, {wall.start[1]:.2f}) to ({wall.end[0]:.2f}, {wall.end[1]:.2f})"
        for wall in contour.walls
        if true_wall(wall, room) is None
    ]
    corners = [
        f"corner at ({one.x_m:.2f}, {one.y_m:.2f})"
        for one in contour.corners
        if np.hypot(*(room.vertices - (one.x_m, one.y_m)).T).min() > NEAR_M
    ]
    cylinders = [
        f"cylinder at ({one.x_m:.2f}, {one.y_m:.2f}) of radius {one.radius_m:.2f}"
        for one in contour.cylinders
        if not any(alike(one, true, within_m) for true, within_m in zip(room.cylinders, near_m, strict=True))
    ]
    return (*walls, *corners, *cylinders)


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


def _lengths_m(vectors: np.ndarray) -> np.ndarray:
    """Of the first two coordinates of (n, k), (n,)."""
    return np.hypot(vectors[:, 0], vectors[:, 1])


def _off_walls_m(point: np.ndarray, room: Room) -> float:
    return float(distance_to_sides_m(point, room.vertices).min())


def _corners_due(room: Room, surveyed: Sequence[LabelledSweep]) -> np.ndarray:
    """Which corners and edges must be found, bool (n,): those whose two walls answered from enough places each."""
    places: list[set[tuple[float, float]]] = [set() for _ in room.vertices]
    for one in surveyed:
        for label in one.labels:
            if label.kind == "wall":
                places[label.index].add((one.sweep.x_m, one.sweep.y_m))
    enough = np.array([len(seen) >= LEAST_PLACES for seen in places])
    return enough & np.roll(enough, 1)


def _cylinders_due(told: LabelFit) -> list[int]:
    """Which cylinders must be found: those whose radius the echoes determine to a quarter."""
    sigma_m = np.sqrt(variances(told.cylinder_covariances)[:, 2])
    return [i for i, radius_m in enumerate(told.cylinders[:, 2]) if sigma_m[i] < radius_m / RADIUS_SIGMAS]


def _same_cylinder(contour: Contour, room: Room, index: int) -> Cylinder | None:
    """The nearest of the found cylinders that are the room's ``index``-th."""
    x, y, _ = true = room.cylinders[index]
    found = [one for one in contour.cylinders if alike(one, true)]
    return min(found, key=lambda one: np.hypot(one.x_m - x, one.y_m - y), default=None)


def alike(one: Cylinder, true: tuple[float, float, float], near_m: float = NEAR_M) -> bool:
    """Whether it is the true one, by centre and radius."""
    x, y, radius = true
    return bool(np.hypot(one.x_m - x, one.y_m - y) <= near_m and abs(one.radius_m - radius) <= near_m)


def true_wall(wall: Wall, room: Room) -> int | None:
    """The true wall that both ends are near, None where there is none."""
    away_m = np.maximum(*(distance_to_sides_m(np.array(end), room.vertices) for end in (wall.start, wall.end)))
    return int(away_m.argmin()) if away_m.min() <= NEAR_M else None


def _missed(room: Room, corners: np.ndarray, cylinders: Sequence[int]) -> tuple[str, ...]:
    vertices, circles = room.vertices[corners], [room.cylinders[i] for i in cylinders]
    return (
        *(f"corner at ({x:.2f}, {y:.2f})" for x, y in vertices),
        *(f"cylinder at ({x:.2f}, {y:.2f}) of radius {radius:.2f}" for x, y, radius in circles),
    )


def wall_squares(contour: Contour, room: Room) -> tuple[float, ...]:
    """Of each wall that is one of the room's, its squared error over its covariance."""
    lines, squares = wall_lines(room), []
    for wall in contour.walls:
        number = true_wall(wall, room)
        if number is not None:
            error = np.array([wall.theta_rad, wall.rho_m]) - lines[number]
            error[0] = (error[0] + np.pi) % (2 * np.pi) - np.pi
            squares.append(_square(error, wall.covariance))
    return tuple(squares)


def corner_squares(contour: Contour, room: Room) -> tuple[float, ...]:
    """Of each corner that is one of the room's, its squared error over its covariance."""
    squares = []
    for one in contour.corners:
        errors = (one.x_m, one.y_m) - room.vertices
        nearest = np.hypot(*errors.T).argmin()
        if np.hypot(*errors[nearest]) <= NEAR_M:
            squares.append(_square(errors[nearest], one.covariance))
    return tuple(squares)


def cylinder_squares(contour: Contour, room: Room) -> tuple[float, ...]:
    """Of each cylinder that is one of the room's, its squared error over its covariance."""
    return tuple(
        _square(np.array([one.x_m, one.y_m, one.radius_m]) - true, one.covariance)
        for one in contour.cylinders
        for true in room.cylinders
        if alike(one, true)
    )


def _square(error: np.ndarray, covariance: np.ndarray) -> float:
    """Squared error over covariance."""
    return float(error @ np.linalg.solve(covariance, error))
