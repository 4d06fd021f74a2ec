"""What an arrangement of units is worth: the chance of all that they hear together, in nats, apart from what all
arrangements have in common.

- A least-squares fit of all poses and reflectors, and the integral about it (Laplace's approximation). Each reflector
  may be anywhere beforehand, so that each agreement counts by how unlikely it is by chance. The walls of a room that
  is all right angles are square to one another, and corners lie where their walls cross.
- Silence, and sound that went through walls (``arrangement_silence``).

It shares no code with the mapper's own weighing, and has every label of the true arrangement.
"""

import math
from collections.abc import Sequence

import numpy as np
from mapper.arrangement import WALL, Group, Scene, point_of, wrapped
from mapper.arrangement_silence import silence_nats
from mapper.label_fit import slopes_of

DIRECTION_SIGMA_RAD, RANGE_SIGMA_M = math.radians(1.1), 0.002  # of one reflector as one unit hears it
ALONE_EACH = 0.4  # reflectors that a unit hears and no other unit does, on average: counted in 138 simulated rooms
SPAN_M = 4.0  # ranges lie anywhere in it
SQUARE_SIGMA_RAD = math.radians(0.2)  # of walls that are square to one another
CORNER_SIGMA_M = 0.001  # of a corner from where its walls cross
STEPS, MOST_STEP, SMALLEST_STEP = 5, 0.5, 1e-4  # metres or radians
WEAK, NEAR_M = 1e-4, 0.02
MOST_MISFIT_NATS = 8.0  # of a group's echoes, after the fit


def worth_nats(
    scene: Scene, poses: np.ndarray, groups: Sequence[Group], chosen: Sequence[int] = ()
) -> tuple[float, np.ndarray]:
    """The log of the chance of all echoes, apart from what all arrangements have in common, and the fitted poses
    (n, 3); ``chosen`` are moved. There is at least one group. Groups that do not fit are taken apart, the worst first.
    """
    while True:  # each round adds a group, until every echo is alone
        nats, fitted, values, misfit_nats = _evidence(scene, poses, groups, chosen)
        misfit_nats[[len(group.members) == 1 for group in groups]] = 0  # these cannot be taken apart
        worst = int(np.argmax(misfit_nats))
        if misfit_nats[worst] < MOST_MISFIT_NATS:
            return nats - silence_nats(scene, fitted, groups, values), fitted
        groups = [*groups[:worst], *_apart(scene, groups[worst], chosen), *groups[worst + 1 :]]


def _apart(scene: Scene, group: Group, chosen: Sequence[int]) -> list[Group]:
    """What the units that moved hear, and what the others hear; if only one of these hears the group, each echo alone.
    On either side all echoes have one label.
    """
    sides = [(is_moved, tuple(m for m in group.members if (m[0] in chosen) == is_moved)) for is_moved in (False, True)]
    if all(members for _, members in sides):
        return [Group(scene.shape_of(members[0][1]), members, members[0][1], is_moved) for is_moved, members in sides]
    return [Group(group.shape, (one,), group.which, group.is_moved) for one in group.members]


def _evidence(
    scene: Scene, poses: np.ndarray, groups: Sequence[Group], chosen: Sequence[int]
) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """The evidence (Laplace's approximation) in nats, the fitted poses (n, 3), the reflectors' values (g, 4) and what
    each group's echoes are off, in nats (g,). Echoes have no errors here; what these add on average is counted.
    """
    crossings = _crossings(scene, groups, chosen)
    values = np.array([_first_values(scene, poses, group) for group in groups])
    fit = _Fit(scene, poses, groups, crossings)
    x = np.concatenate([poses[1:].ravel(), [scene.lines[0, 0]], values[fit.fitted].ravel()])
    hold = np.full(len(x), WEAK)
    hold[: fit.free] = math.tau / SPAN_M**2  # no unit can be farther off than in its room
    hold[fit.free] = WEAK if scene.is_square else 1.0  # the frame of walls that are square to one another
    information = np.eye(len(x))
    for _ in range(STEPS):
        slopes = slopes_of(fit.residuals, x)
        information = slopes.T @ slopes + np.diag(hold)
        step = np.linalg.solve(information, slopes.T @ np.real(fit.residuals(x)))
        x = x - step * min(1.0, MOST_STEP / max(np.abs(step[: fit.free]).max(), 1e-9))
        if np.abs(step).max() < SMALLEST_STEP:
            break
    off = np.real(fit.residuals(x))
    stand = np.vstack([poses[:1], x[: fit.free].reshape(-1, 3)])
    values = np.array([_first_values(scene, stand, group) for group in groups])
    values[fit.fitted] = x[fit.free + 1 :].reshape(-1, 4)
    echoes = len(fit.unit)
    misfit_nats = np.zeros(len(groups))
    np.add.at(misfit_nats, fit.fitted[fit.mark], 0.5 * (off[:echoes] ** 2 + off[echoes : 2 * echoes] ** 2))
    nats = -0.5 * (off**2).sum() - 0.5 * (len(off) - len(x)) + 0.5 * len(x) * math.log(math.tau)
    nats -= 0.5 * float(np.linalg.slogdet(information)[1]) + (np.log(fit.sigma) + 0.5 * math.log(math.tau)).sum()
    nats += _prior_nats(scene, stand, groups, values, crossings, {*fit.fitted.tolist()})
    return float(nats), stand, values, misfit_nats


class _Fit:
    """Poses but u1's, the direction of square walls, and the values of those reflectors that several units hear or
    that make a corner, all in a row; and what they are off, in sigmas.
    """

    def __init__(
        self, scene: Scene, poses: np.ndarray, groups: Sequence[Group], crossings: Sequence[tuple[int, int, int]]
    ) -> None:
        in_crossing = {number for crossing in crossings for number in crossing}
        fitted = [n for n, group in enumerate(groups) if len(group.members) > 1 or n in in_crossing]
        place_of = {number: at for at, number in enumerate(fitted)}
        members = [(unit, place_of[n], scene.echoes[unit][which]) for n in fitted for unit, which in groups[n].members]
        self.first, self.free, self.is_square = poses[0], 3 * (len(poses) - 1), scene.is_square
        self.fitted = np.array(fitted, int)  # numbers of groups
        self.unit, self.mark = np.array([one[:2] for one in members], int).reshape(-1, 2).T
        self.direction_rad = np.array([echo.direction_rad for _, _, echo in members])
        self.range_m = np.array([echo.range_m for _, _, echo in members])
        self.is_wall = np.array([groups[n].shape.is_wall for n in fitted], bool)
        self.mean = np.array([groups[n].shape.mean for n in fitted]).reshape(-1, 2)
        self.sigma = np.array([groups[n].shape.sigma for n in fitted]).reshape(-1, 2)
        crossed = [[place_of[number] for number in one] for one in crossings]
        self.corner, *self.walls = np.array(crossed, int).reshape(-1, 3).T

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Of directions and ranges, of k and r, of corners off their walls and walls that are not square."""
        pose = np.concatenate([self.first, x[: self.free]]).reshape(-1, 3)[self.unit]
        marks = x[self.free + 1 :].reshape(-1, 4)
        off_rad, off_m = self._of_echoes(pose, marks[self.mark])
        known = ((marks[:, 2:] - self.mean) / self.sigma).ravel()
        corner_m = [
            marks[self.corner, 0] * np.cos(marks[wall, 0])
            + marks[self.corner, 1] * np.sin(marks[wall, 0])
            - marks[wall, 1]
            for wall in self.walls
        ]
        square = np.sin(4 * (marks[self.is_wall, 0] - x[self.free])) / 4 / SQUARE_SIGMA_RAD
        parts = [off_rad / DIRECTION_SIGMA_RAD, off_m / RANGE_SIGMA_M, known, *(m / CORNER_SIGMA_M for m in corner_m)]
        return np.concatenate([*parts, square if self.is_square else square[:0]])

    def _of_echoes(self, pose: np.ndarray, mark: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        wall, axis = self.is_wall[self.mark], pose[:, 2] + self.direction_rad
        way = mark[:, :2] - pose[:, :2]
        away = np.sqrt((way**2).sum(axis=1))
        away = np.where(np.real(away) > NEAR_M, away, NEAR_M)
        wall_m = mark[:, 1] - pose[:, 0] * np.cos(mark[:, 0]) - pose[:, 1] * np.sin(mark[:, 0])
        across = (np.sin(axis) * way[:, 0] - np.cos(axis) * way[:, 1]) / away
        range_m = np.where(wall, wall_m, mark[:, 2] * away - mark[:, 3])
        return np.where(wall, np.sin(axis - mark[:, 0]), across), self.range_m - range_m


def _prior_nats(
    scene: Scene,
    poses: np.ndarray,
    groups: Sequence[Group],
    values: np.ndarray,
    crossings: Sequence[tuple[int, int, int]],
    fitted: set[int],
) -> float:
    """How likely reflectors like these are beforehand; of those that are not fitted, the echo's evidence."""
    crossed, nats = {number: walls for number, *walls in crossings}, 0.0
    peak = 1 / (4 * math.sqrt(math.tau) * DIRECTION_SIGMA_RAD)  # of the direction of a wall that is square
    for number, (group, value) in enumerate(zip(groups, values, strict=True)):
        nats += math.log(group.shape.share if len(group.members) > 1 else ALONE_EACH)
        square = scene.is_square and group.shape.is_wall
        if number not in fitted:
            density = WALL.share * peak + (1 - WALL.share) / math.tau if square else 1 / math.tau
            nats += math.log(density / SPAN_M * math.tau * DIRECTION_SIGMA_RAD * RANGE_SIGMA_M)
        elif number in crossed:
            one, other = values[crossed[number], 0]
            nats += math.log(abs(math.sin(other - one))) - 2 * math.log(CORNER_SIGMA_M) - math.log(math.tau)
        elif group.shape.is_wall:
            nats -= math.log(SPAN_M)
            nats -= math.log(4 * SQUARE_SIGMA_RAD * math.sqrt(math.tau)) if square else math.log(math.tau)
        else:
            away_m = math.hypot(*(value[:2] - poses[min(unit for unit, _ in group.members), :2]))
            nats -= math.log(SPAN_M * math.tau * max(away_m, NEAR_M))
    return nats


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
