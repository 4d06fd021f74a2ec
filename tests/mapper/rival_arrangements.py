"""Other arrangements of the units that explain what they hear nearly as well: some of them moved as one, elsewhere.

An observer without labels, but with unlimited computing and with all statistics of the simulated rooms, weighs every
arrangement by the chance of all echoes together. Here labels tell what the true arrangement is worth, and which others
could compete. A rival moves a set of units, never u1, as one: where two reflectors that they hear, or that are in the
room, come to lie on two that the others hear. What a unit hears there is the others' reflector if direction and range
agree, else a reflector of the units that moved, which nobody knows: any room will do that is consistent with the
echoes. Weighed are at most ``MOST_WEIGHED`` rivals, those that agree best; others, and sets of units that move by
different shifts, are taken for unlikely. Truth and rivals are weighed alike, in nats:

- the evidence of a least-squares fit of all poses and reflectors: each reflector may be anywhere beforehand (a
  rectangular room's walls are square to one another), so that each agreement counts by how unlikely it is by chance;
- silence: walls and points that a unit ought to hear, by how often that happens in simulated rooms;
- sound that went through a wall, which is then two walls that lie on one line by chance.

Each rival can be looked at: who moved, and where to.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from mapper.arrangement import CORNER, WALL, Group, Reflector, Scene, Shape, moved, point_of, true_groups, wrapped
from mapper.arrangement_worth import worth_nats

ALIKE_M, ALIKE_RAD = 0.05, math.radians(4)  # before the fit
MOST_FEWER, LEAST_AGREE = 2, 2  # agreements that a rival may have less than the truth, and must have, to be weighed
MOST_WEIGHED = 60
SAME_M, SAME_RAD = 0.15, math.radians(6)
LEAST_SINE = 0.2  # of the angle between two lines that fix a shift


@dataclass(frozen=True, eq=False)
class Rival:
    """The units that are moved (numbers from 0), the fitted poses of all units (n, 3), and how many nats more the truth
    is worth.
    """

    units: tuple[int, ...]
    poses: np.ndarray
    behind_nats: float


@dataclass(frozen=True, eq=False)
class _Candidate:
    """How many agreements less than in the truth, which units are moved, by what, and what agrees then."""

    fewer: int
    chosen: tuple[int, ...]
    shift: np.ndarray
    groups: list[Group]


def rivals(scene: Scene) -> list[Rival]:
    """The rivals, the worthiest first, each arrangement once; none where nothing is heard for sure."""
    if not scene.all:
        return []
    truth_nats, _ = worth_nats(scene, scene.poses, true_groups(scene))
    weighed = []
    for one in _most_agreeing(scene)[:MOST_WEIGHED]:
        poses = scene.poses.copy()
        poses[list(one.chosen)] = moved(one.shift, poses[list(one.chosen)])
        nats, fitted = worth_nats(scene, poses, one.groups, one.chosen)
        weighed.append(Rival(one.chosen, fitted, truth_nats - nats))
    found: list[Rival] = []
    for rival in sorted(weighed, key=lambda one: one.behind_nats):
        if not any(rival.units == one.units and not _elsewhere(rival.poses, one.poses).any() for one in found):
            found.append(rival)
    return found


def _most_agreeing(scene: Scene) -> list[_Candidate]:
    """The candidates that lose the fewest agreements first, one for each set of units and place."""
    best: dict[tuple[tuple[int, ...], tuple[int, ...]], _Candidate] = {}
    for one in _candidates(scene):
        cell = np.rint(moved(one.shift, scene.poses[list(one.chosen)]).mean(axis=0) / (SAME_M, SAME_M, SAME_RAD))
        key = one.chosen, (int(cell[0]), int(cell[1]), int(cell[2]) % 60)
        if key not in best or one.fewer < best[key].fewer:
            best[key] = one
    return sorted(best.values(), key=lambda one: (one.fewer, len(one.chosen)))


@dataclass(frozen=True, eq=False)
class _Hypotheses:
    """What the echoes of units that moved may be: reflectors as they are, and those that one unit alone hears as the
    wall, or the corner, that it may be for all this unit knows.
    """

    which: list[Reflector]
    by: list[int]  # the one unit, or -1
    shape: list[Shape]
    line: np.ndarray  # (h, 2) alpha, rho
    point: np.ndarray  # (h, 4) x, y, k, r

    def predicted(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Directions outside, and ranges, from ``poses`` (..., 3): (..., h)."""
        is_wall = np.array([one.is_wall for one in self.shape])
        x_m, y_m = poses[..., :1], poses[..., 1:2]
        wall_m = self.line[:, 1] - x_m * np.cos(self.line[:, 0]) - y_m * np.sin(self.line[:, 0])
        dx_m, dy_m = self.point[:, 0] - x_m, self.point[:, 1] - y_m
        point_m = self.point[:, 2] * np.hypot(dx_m, dy_m) - self.point[:, 3]
        return np.where(is_wall, self.line[:, 0], np.arctan2(dy_m, dx_m)), np.where(is_wall, wall_m, point_m)


def _hypotheses(scene: Scene) -> _Hypotheses:
    found: list[tuple[Reflector, int, Shape, tuple[float, float], tuple[float, float, float, float]]] = []
    none, nowhere = (0.0, 0.0), (0.0, 0.0, 1.0, 0.0)
    for which in scene.all:
        number = which[1]
        shape = scene.shape_of(which)
        if shape.is_wall:
            alpha_rad, rho_m = scene.lines[number]
            found.append((which, -1, shape, (float(alpha_rad), float(rho_m)), nowhere))
        else:
            x_m, y_m, k, r_m = point_of(scene, which)
            found.append((which, -1, shape, none, (x_m, y_m, k, r_m)))
        for unit in scene.hear(which):
            x_m, y_m, heading_rad = scene.poses[unit]
            echo = scene.echoes[unit][which]
            axis_rad = heading_rad + echo.direction_rad
            cosine, sine = math.cos(axis_rad), math.sin(axis_rad)
            if shape.is_wall:
                at = (x_m + echo.range_m * cosine, y_m + echo.range_m * sine, 1.0, 0.0)
                found.append((which, unit, CORNER, none, at))
            else:
                line = (axis_rad, x_m * cosine + y_m * sine + echo.range_m)
                found.append((which, unit, WALL, line, nowhere))
    which, by, shape, line, point = (list(each) for each in zip(*found, strict=True))
    return _Hypotheses(which, by, shape, np.array(line), np.array(point))


def _shifts(scene: Scene) -> np.ndarray:
    """By what units may be moved, (k, 3): two lines that they hear, or a line and a point, come to lie on others."""
    touches = []
    for pose, own in zip(scene.poses, scene.echoes, strict=True):
        for which, echo in own.items():
            if which[0] != "wall":
                axis_rad = pose[2] + echo.direction_rad
                rho_m = pose[0] * math.cos(axis_rad) + pose[1] * math.sin(axis_rad) + echo.range_m
                touches.append((axis_rad, rho_m))
    points = np.array([point_of(scene, which)[:2] for which in scene.all if which[0] != "wall"]).reshape(-1, 2)
    sources = np.array([*(tuple(line) for line in scene.lines), *touches])
    shifts = np.concatenate([_by_two_lines(sources, scene.lines), _by_line_and_point(scene.lines, points)])
    middle = np.append(scene.poses[:, :2].mean(axis=0), 0.0)
    cell = np.rint(moved(shifts, middle[None]) / (0.05, 0.05, math.radians(2))).astype(int)
    cell[:, 2] %= 180
    _, first = np.unique(cell, axis=0, return_index=True)
    return shifts[first]


def _by_two_lines(sources: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Shifts (k, 3) that lay two lines of ``sources`` (s, 2) on two of ``targets`` (t, 2)."""
    s, t = np.arange(len(sources)), np.arange(len(targets))
    one, other, on_one, on_other = (each.ravel() for each in np.meshgrid(s, s, t, t))
    keep = (one < other) & (on_one != on_other)
    one, other = sources[one[keep]], sources[other[keep]]
    on_one, on_other = targets[on_one[keep]], targets[on_other[keep]]
    one_m, other_m = on_one[:, 1] - one[:, 1], on_other[:, 1] - other[:, 1]
    one_rad = on_one[:, 0] - one[:, 0]
    apart_rad = wrapped(on_other[:, 0] - other[:, 0] - one_rad)
    alpha, beta = on_one[:, 0], on_other[:, 0]
    sine = np.sin(beta - alpha)
    fits = (np.abs(apart_rad) < ALIKE_RAD) & (np.abs(sine) > LEAST_SINE)
    sine = np.where(fits, sine, 1.0)
    x_m = (one_m * np.sin(beta) - other_m * np.sin(alpha)) / sine
    y_m = (other_m * np.cos(alpha) - one_m * np.cos(beta)) / sine
    return np.stack([x_m, y_m, one_rad + apart_rad / 2], axis=1)[fits]


def _by_line_and_point(lines: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Shifts (k, 3) that lay one of ``lines`` (w, 2) on another or itself, and a point of ``points`` (p, 2) too."""
    found = [np.empty((0, 3))]
    for alpha, rho_m in lines:
        for on_alpha, on_rho_m in lines:
            turn_rad = on_alpha - alpha
            turned = moved(np.array([0.0, 0.0, turn_rad]), np.column_stack([points, np.zeros(len(points))]))[:, :2]
            shift = points[:, None] - turned[None]
            off_m = shift @ (math.cos(on_alpha), math.sin(on_alpha)) - (on_rho_m - rho_m)
            fits = shift[np.abs(off_m) < ALIKE_M]
            found.append(np.column_stack([fits, np.full(len(fits), turn_rad)]))
    return np.concatenate(found)


def _candidates(scene: Scene) -> Iterator[_Candidate]:
    """All sets of units without u1, moved elsewhere by every shift, that lose few agreements."""
    might, units = _hypotheses(scene), range(1, len(scene.poses))
    sets = [chosen for count in units for chosen in combinations(units, count)]
    allowed = {chosen: _allowed(scene, might, chosen) for chosen in sets}
    shared = {chosen: _shared(scene, chosen) for chosen in sets}
    for shift in _shifts(scene):
        there = moved(shift, scene.poses)
        elsewhere = _elsewhere(there, scene.poses)
        if not elsewhere[1:].any():
            continue
        fits = _fits(scene, might, there)
        for chosen in sets:
            if not elsewhere[list(chosen)].all():
                continue
            agree = _agree(scene, might, chosen, allowed[chosen], fits)
            fewer = shared[chosen] - len(agree)
            if fewer <= MOST_FEWER and len(agree) >= LEAST_AGREE:
                yield _Candidate(fewer, chosen, shift, _groups(scene, might, chosen, agree))


def _shared(scene: Scene, chosen: tuple[int, ...]) -> int:
    """How many reflectors both ``chosen`` and others hear."""
    return sum(len({unit in chosen for unit in scene.hear(which)}) == 2 for which in scene.all)


def _allowed(scene: Scene, might: _Hypotheses, chosen: tuple[int, ...]) -> int:
    """The hypotheses, a bit each, that the units other than ``chosen`` leave open."""
    mask = 0
    for h, (which, by) in enumerate(zip(might.which, might.by, strict=True)):
        left = [unit for unit in scene.hear(which) if unit not in chosen]
        mask |= (bool(left) if by < 0 else left == [by]) << h
    return mask


def _fits(scene: Scene, might: _Hypotheses, there: np.ndarray) -> dict[tuple[int, Reflector], int]:
    """The hypotheses, a bit each, that each echo agrees with where the units stand ``there`` (n, 3)."""
    direction_rad, range_m = might.predicted(there)
    masks = {}
    for unit, own in enumerate(scene.echoes):
        for which, echo in own.items():
            off_rad = np.abs(wrapped(there[unit, 2] + echo.direction_rad - direction_rad[unit]))
            fits = (off_rad < ALIKE_RAD) & (np.abs(range_m[unit] - echo.range_m) < ALIKE_M)
            masks[unit, which] = sum(1 << h for h in np.flatnonzero(fits).tolist())
    return masks


def _agree(
    scene: Scene,
    might: _Hypotheses,
    chosen: tuple[int, ...],
    allowed: int,
    fits: dict[tuple[int, Reflector], int],
) -> dict[int, Reflector]:
    """What ``chosen`` hear, by the hypothesis that all their echoes of it agree with; a reflector counts once."""
    agree: dict[int, Reflector] = {}
    for which in scene.all:
        own = [unit for unit in scene.hear(which) if unit in chosen]
        mask = allowed if own else 0
        for unit in own:
            mask &= fits[unit, which]
        for h in _ones(mask):
            if all(might.which[h] != might.which[used] for used in agree):
                agree[h] = which
                break
    return agree


def _ones(mask: int) -> Iterator[int]:
    while mask:
        lowest = mask & -mask
        yield lowest.bit_length() - 1
        mask ^= lowest


def _elsewhere(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Which poses (n, 3) are others."""
    off_m = np.hypot(*(one - other)[:, :2].T)
    return (off_m > SAME_M) | (np.abs(wrapped(one[:, 2] - other[:, 2])) > SAME_RAD)


def _groups(
    scene: Scene,
    might: _Hypotheses,
    chosen: tuple[int, ...],
    agree: dict[int, Reflector],
) -> list[Group]:
    """Which echoes are one reflector's where ``chosen`` are moved."""
    matched = {might.which[h]: (h, which) for h, which in agree.items()}
    groups, done = [], set(agree.values())
    for which in scene.all:
        left = [(unit, which) for unit in scene.hear(which) if unit not in chosen]
        shape = scene.shape_of(which)
        if which in matched:
            h, other = matched[which]
            left += [(unit, other) for unit in scene.hear(other) if unit in chosen]
            shape = might.shape[h]
        if left:
            groups.append(Group(shape, tuple(left), which))
        own = tuple((unit, which) for unit in scene.hear(which) if unit in chosen)
        if own and which not in done:
            groups.append(Group(scene.shape_of(which), own, which, True))
    return groups
