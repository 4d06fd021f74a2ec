"""What an arrangement of units is worth: the chance of all that they hear together, in nats, but for what all
arrangements have in common.

- A least-squares fit of all poses and reflectors, and the integral about it (Laplace's approximation). Each reflector
  may be anywhere beforehand, so that each agreement counts by how unlikely it is by chance. The walls of a room that
  is all right angles are square to one another, and corners lie where their walls cross.
- Silence, and sound that went through walls (``arrangement_silence``).

It shares no code with the mapper's own weighing, and is told every label of the true arrangement.
"""

import math
from collections.abc import Sequence

import numpy as np
from mapper.arrangement import WALL, Group, Reflector, Scene, point_of, wrapped
from mapper.arrangement_silence import silence_nats
from mapper.label_fit import slopes_of

DIRECTION_SIGMA_RAD, RANGE_SIGMA_M = math.radians(1.1), 0.002  # of one reflector as one unit hears it
SPAN_M = 4.0  # ranges lie anywhere in it
SQUARE_SIGMA_RAD = math.radians(0.2)  # of walls that are square to one another
CORNER_SIGMA_M = 0.001  # of a corner from where its walls cross
SMALLEST_STEP = 1e-4  # metres or radians
MOST_MISFIT_NATS = 8.0  # of a group's echoes, after the fit


def worth_nats(scene: Scene, poses: np.ndarray, groups: Sequence[Group], chosen: Sequence[int] = ()) -> float:
    """The log of the chance of all echoes, but for what all arrangements have in common; ``chosen`` are moved. Groups
    that do not fit are taken apart.
    """
    for _ in range(4):
        nats, fitted, values, misfit_nats = _evidence(scene, poses, groups, chosen)
        worst = int(np.argmax(misfit_nats)) if len(misfit_nats) else -1
        if worst < 0 or misfit_nats[worst] < MOST_MISFIT_NATS:
            break
        groups = [*groups[:worst], *_apart(scene, groups[worst]), *groups[worst + 1 :]]
    return nats - silence_nats(scene, fitted, groups, values)


def _apart(scene: Scene, group: Group) -> list[Group]:
    by_label: dict[Reflector, list[tuple[int, Reflector]]] = {}
    for unit, which in group.members:
        by_label.setdefault(which, []).append((unit, which))
    if len(by_label) > 1:
        return [
            Group(scene.shape_of(which), tuple(members), which, which != group.which)
            for which, members in by_label.items()
        ]
    return [Group(group.shape, (one,), group.which, group.is_moved) for one in group.members]


def _evidence(
    scene: Scene, poses: np.ndarray, groups: Sequence[Group], chosen: Sequence[int]
) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """The evidence (Laplace's approximation) in nats, the fitted poses (n, 3), the reflectors' values (g, 4) and what
    each group's echoes are off, in nats (g,). Echoes have no errors here; what these add on average is counted.
    """
    values = np.array([_first_values(scene, poses, group) for group in groups])
    crossings = _crossings(scene, groups, chosen)
    many = [
        number
        for number, group in enumerate(groups)
        if len(group.members) > 1 or any(number in crossing for crossing in crossings)
    ]
    crossed = {number: (one, other) for number, one, other in crossings}
    place_of = {number: at for at, number in enumerate(many)}
    corner, *walls = np.array([[place_of[number] for number in one] for one in crossings], int).reshape(-1, 3).T
    members = [(unit, at, scene.echoes[unit][which]) for at, n in enumerate(many) for unit, which in groups[n].members]
    unit = np.array([one[0] for one in members], int)
    at = np.array([one[1] for one in members], int)
    direction_rad = np.array([one[2].direction_rad for one in members])
    range_m = np.array([one[2].range_m for one in members])
    is_wall = np.array([groups[n].shape.is_wall for n in many], bool)
    mean = np.array([groups[n].shape.mean for n in many]).reshape(-1, 2)
    sigma = np.array([groups[n].shape.sigma for n in many]).reshape(-1, 2)
    wall = is_wall[at]
    free = 3 * (len(poses) - 1)
    frame_rad = float(scene.lines[0, 0])

    def residuals(x: np.ndarray) -> np.ndarray:
        pose = np.concatenate([poses[0] + 0 * x[:3], x[:free]]).reshape(-1, 3)[unit]
        all_marks = x[free + 1 :].reshape(-1, 4)
        mark = all_marks[at]
        axis = pose[:, 2] + direction_rad
        cosine, sine = np.cos(mark[:, 0]), np.sin(mark[:, 0])
        way = mark[:, :2] - pose[:, :2]
        away = np.sqrt((way**2).sum(axis=1))
        away = np.where(np.real(away) > 0.02, away, 0.02)
        of_wall = np.sin(axis - mark[:, 0]), range_m - (mark[:, 1] - pose[:, 0] * cosine - pose[:, 1] * sine)
        of_point = (
            (np.sin(axis) * way[:, 0] - np.cos(axis) * way[:, 1]) / away,
            range_m - (mark[:, 2] * away - mark[:, 3]),
        )
        off = [np.where(wall, one, other) for one, other in zip(of_wall, of_point, strict=True)]
        known = ((all_marks[:, 2:] - mean) / sigma).ravel()
        square = np.sin(4 * (all_marks[is_wall, 0] - x[free])) / 4 / SQUARE_SIGMA_RAD
        on_walls = [
            all_marks[corner, 0] * np.cos(all_marks[one, 0])
            + all_marks[corner, 1] * np.sin(all_marks[one, 0])
            - all_marks[one, 1]
            for one in walls
        ]
        parts = [
            off[0] / DIRECTION_SIGMA_RAD,
            off[1] / RANGE_SIGMA_M,
            known,
            *(one / CORNER_SIGMA_M for one in on_walls),
        ]
        return np.concatenate([*parts, square if scene.is_square else 0 * x[free : free + 1]])

    x = np.concatenate([poses[1:].ravel(), [frame_rad], values[many].ravel()])
    size = len(x)
    hold = np.full(size, 1e-4)
    hold[free] = 1.0 if not scene.is_square else 1e-4
    information = np.eye(size)
    for _ in range(5):
        slopes = slopes_of(residuals, x)
        information = slopes.T @ slopes + np.diag(hold)
        step = np.linalg.solve(information, slopes.T @ np.real(residuals(x)))
        x = x - step * min(1.0, 0.5 / max(np.abs(step[:free]).max(), 1e-9))
        if np.abs(step).max() < SMALLEST_STEP:
            break
    off = np.real(residuals(x))
    n = len(unit)
    fitted = np.vstack([poses[:1], x[:free].reshape(-1, 3)])
    values[many] = x[free + 1 :].reshape(-1, 4)
    misfit = np.zeros(len(groups))
    np.add.at(misfit, np.array(many, int)[at], 0.5 * (off[:n] ** 2 + off[n : 2 * n] ** 2))
    for number, group in enumerate(groups):
        if number not in place_of:
            values[number] = _first_values(scene, fitted, group)
    nats = -0.5 * (off**2).sum() - 0.5 * (len(off) - size) + 0.5 * size * math.log(math.tau)
    nats -= 0.5 * float(np.linalg.slogdet(information)[1])
    nats -= (np.log(sigma) + 0.5 * math.log(math.tau)).sum()
    for number in many:
        group = groups[number]
        nats += math.log(group.shape.share) if len(group.members) > 1 else 0.0
        if number in crossed:
            one, other = (values[at, 0] for at in crossed[number])
            nats += math.log(abs(math.sin(other - one))) - 2 * math.log(CORNER_SIGMA_M) - math.log(math.tau)
            continue
        nats -= math.log(SPAN_M)
        if not group.shape.is_wall:
            first = fitted[min(unit for unit, _ in group.members), :2]
            nats -= math.log(math.tau) + math.log(max(math.hypot(*(values[number, :2] - first)), 0.02))
        elif scene.is_square:
            nats -= math.log(4) + math.log(SQUARE_SIGMA_RAD) + 0.5 * math.log(math.tau)
        else:
            nats -= math.log(math.tau)
    peak = 1 / (4 * math.sqrt(math.tau) * DIRECTION_SIGMA_RAD)
    for number, group in enumerate(groups):
        if number not in place_of:
            square = scene.is_square and group.shape.is_wall
            density = (WALL.share * peak + (1 - WALL.share) / math.tau if square else 1 / math.tau) / SPAN_M
            nats += math.log(density * math.tau * DIRECTION_SIGMA_RAD * RANGE_SIGMA_M)
    return float(nats), fitted, values, misfit


def _crossings(scene: Scene, groups: Sequence[Group], chosen: Sequence[int]) -> list[tuple[int, int, int]]:
    """Corners that lie where two walls cross, as all corners do: numbers of the three groups. What units that moved
    hear are walls of their own, or what agrees with these.
    """
    count, of_wall = len(scene.lines), {}
    for number, group in enumerate(groups):
        for unit, (kind, wall) in group.members:
            if kind == "wall" and group.shape.is_wall:
                of_wall[wall, unit in chosen] = number
    found = []
    for number, group in enumerate(groups):
        kind, corner = group.which
        pair = [of_wall.get((wall % count, group.is_moved)) for wall in (corner - 1, corner)]
        if kind in ("corner", "edge") and not group.shape.is_wall and None not in pair and pair[0] != pair[1]:
            found.append((number, pair[0], pair[1]))
    return found


def _first_values(scene: Scene, poses: np.ndarray, group: Group) -> np.ndarray:
    """A wall's alpha and rho, k and r that mean nothing; or a point's x, y, k and r."""
    axis_rad = np.array([poses[unit, 2] + scene.echoes[unit][which].direction_rad for unit, which in group.members])
    range_m = np.array([scene.echoes[unit][which].range_m for unit, which in group.members])
    place = np.array([poses[unit, :2] for unit, _ in group.members])
    k, r_m = group.shape.mean
    if group.shape.is_wall:
        alpha_rad = axis_rad[0] + wrapped(axis_rad - axis_rad[0]).mean()
        rho_m = (range_m + place @ (math.cos(alpha_rad), math.sin(alpha_rad))).mean()
        return np.array([alpha_rad, rho_m, k, r_m])
    labels = {which for _, which in group.members}
    natural = [scene.shape_of(which) for which in labels]
    if group.shape in natural:
        which = next(which for which in labels if scene.shape_of(which) == group.shape)
        k, r_m = point_of(scene, which)[2:]
    heard = place + ((range_m + r_m) / k)[:, None] * np.stack([np.cos(axis_rad), np.sin(axis_rad)], axis=1)
    return np.array([*heard.mean(axis=0), k, r_m])
