"""Other arrangements of the units that explain what they hear nearly as well: some of them moved as one, elsewhere.

An observer without labels, but with unlimited computing and with all statistics of the simulated rooms, weighs every
arrangement by the chance of all echoes together. Here labels tell what the true arrangement is worth, and which others
could compete. A rival moves a set of units, never u1, as one: where two reflectors that they hear, or that are in the
room, come to lie on two that the others hear. What a unit hears there is the others' reflector if direction and range
agree, else a reflector of the units that moved, which nobody knows: any room will do that is consistent with the
echoes. Both are weighed alike, in nats:

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
MOST_FEWER = 2  # agreements that a rival may have less than the truth, to be weighed at all
MOST_WEIGHED = 60
SAME_M, SAME_RAD = 0.15, math.radians(6)


@dataclass(frozen=True, eq=False)
class Rival:
    """The units that are moved (numbers from 0), by what (x_m, y_m, turn_rad), and by how many nats the truth is worth
    more.
    """

    units: tuple[int, ...]
    shift: np.ndarray
    behind_nats: float


def rivals(scene: Scene, most: int = MOST_WEIGHED) -> list[Rival]:
    """The rivals that agree most with what the others hear, the worthiest first."""
    best: dict[tuple[tuple[int, ...], tuple[int, ...]], tuple[int, np.ndarray, list[Group]]] = {}
    for fewer, chosen, shift, groups in _candidates(scene):
        there = moved(shift, scene.poses[list(chosen)]).mean(axis=0)
        key = chosen, tuple(np.rint(there / (SAME_M, SAME_M, SAME_RAD)).astype(int).tolist())
        if key not in best or fewer < best[key][0]:
            best[key] = fewer, shift, groups
    ranked = sorted(best.items(), key=lambda one: (one[1][0], len(one[0][0])))
    truth_nats = worth_nats(scene, scene.poses, true_groups(scene))[0]
    found = []
    for (chosen, _), (_, shift, groups) in ranked[:most]:
        poses = scene.poses.copy()
        poses[list(chosen)] = moved(shift, poses[list(chosen)])
        found.append(Rival(chosen, shift, truth_nats - worth_nats(scene, poses, groups, chosen)[0]))
    return sorted(found, key=lambda one: one.behind_nats)


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
    lines = [tuple(line) for line in scene.lines]
    touches = []
    for pose, own in zip(scene.poses, scene.echoes, strict=True):
        for which, echo in own.items():
            if which[0] != "wall":
                axis_rad = pose[2] + echo.direction_rad
                rho_m = pose[0] * math.cos(axis_rad) + pose[1] * math.sin(axis_rad) + echo.range_m
                touches.append((axis_rad, rho_m))
    points = np.array([point_of(scene, which)[:2] for which in scene.all if which[0] != "wall"]).reshape(-1, 2)
    targets = np.array(lines)
    sources = np.array([*lines, *touches])
    found = []
    s, t = len(sources), len(targets)
    a, b, c, d = (each.ravel() for each in np.meshgrid(np.arange(s), np.arange(s), np.arange(t), np.arange(t)))
    keep = (a < b) & (c != d)
    a, b, c, d = a[keep], b[keep], c[keep], d[keep]
    one_rad, other_rad = targets[c, 0] - sources[a, 0], targets[d, 0] - sources[b, 0]
    apart_rad = wrapped(other_rad - one_rad)
    turn_rad = one_rad + apart_rad / 2
    sine = np.sin(targets[d, 0] - targets[c, 0])
    keep = (np.abs(apart_rad) < ALIKE_RAD) & (np.abs(sine) > 0.2)
    a, b, c, d, turn_rad, sine = a[keep], b[keep], c[keep], d[keep], turn_rad[keep], sine[keep]
    first_m, second_m = targets[c, 1] - sources[a, 1], targets[d, 1] - sources[b, 1]
    alpha, beta = targets[c, 0], targets[d, 0]
    x_m = (first_m * np.sin(beta) - second_m * np.sin(alpha)) / sine
    y_m = (second_m * np.cos(alpha) - first_m * np.cos(beta)) / sine
    found.append(np.stack([x_m, y_m, turn_rad], axis=1))
    for one in range(len(scene.lines)):
        for other in range(len(scene.lines)):
            turn = float(scene.lines[other, 0] - scene.lines[one, 0])
            turned = points @ np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
            shift = points[:, None] - turned[None]
            normal = np.array([math.cos(scene.lines[other, 0]), math.sin(scene.lines[other, 0])])
            off_m = shift @ normal - (scene.lines[other, 1] - scene.lines[one, 1])
            fits = shift[np.abs(off_m) < ALIKE_M]
            found.append(np.column_stack([fits, np.full(len(fits), turn)]))
    shifts = np.concatenate(found)
    middle = np.append(scene.poses[:, :2].mean(axis=0), 0.0)
    away = moved(shifts, middle[None])
    away[:, 2] = wrapped(away[:, 2])
    cell = np.rint(away / (0.05, 0.05, math.radians(2))).astype(int)
    _, first = np.unique(cell, axis=0, return_index=True)
    return shifts[first]


def _candidates(scene: Scene) -> Iterator[tuple[int, tuple[int, ...], np.ndarray, list[Group]]]:
    """How many agreements less than in the truth, which units, by what they are moved, and what agrees then."""
    if not scene.all:
        return
    might, shifts, units = _hypotheses(scene), _shifts(scene), len(scene.poses)
    sets = [s for count in range(1, units) for s in combinations(range(1, units), count)]
    hear = {which: scene.hear(which) for which in scene.all}
    natural = {which: 1 << h for h, which in enumerate(might.which) if might.by[h] < 0}
    alone = {(which, might.by[h]): 1 << h for h, which in enumerate(might.which) if might.by[h] >= 0}
    allowed = {}
    for chosen in sets:
        mask = 0
        for which in scene.all:
            left = [unit for unit in hear[which] if unit not in chosen]
            mask |= natural[which] if left else 0
            mask |= alone[which, left[0]] if len(left) == 1 else 0
        allowed[chosen] = mask
    shared = {
        chosen: sum(0 < sum(unit in chosen for unit in hear[which]) < len(hear[which]) for which in scene.all)
        for chosen in sets
    }
    bits = 1 << np.arange(len(might.which), dtype=object)
    for shift in shifts:
        masks: dict[tuple[int, Reflector], int] = {}
        there = moved(shift, scene.poses)
        elsewhere = _elsewhere(there, scene.poses)
        if not elsewhere[1:].any():
            continue
        direction_rad, range_m = might.predicted(there)
        for unit in range(1, units):
            for which, echo in scene.echoes[unit].items():
                off_rad = np.abs(wrapped(there[unit, 2] + echo.direction_rad - direction_rad[unit]))
                fits = (off_rad < ALIKE_RAD) & (np.abs(range_m[unit] - echo.range_m) < ALIKE_M)
                masks[unit, which] = int(bits[fits].sum()) if fits.any() else 0
        for chosen in sets:
            if not elsewhere[list(chosen)].all():
                continue
            agree: dict[int, Reflector] = {}
            for which in scene.all:
                own = [unit for unit in hear[which] if unit in chosen]
                mask = allowed[chosen] if own else 0
                for unit in own:
                    mask &= masks[unit, which]
                for h in _ones(mask):
                    if all(might.which[h] != might.which[used] for used in agree):
                        agree[h] = which
                        break
            fewer = shared[chosen] - len(agree)
            if fewer <= MOST_FEWER and len(agree) >= 2:
                yield fewer, chosen, shift, _groups(scene, might, hear, chosen, agree)


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
    hear: dict[Reflector, tuple[int, ...]],
    chosen: tuple[int, ...],
    agree: dict[int, Reflector],
) -> list[Group]:
    """Which echoes are one reflector's where ``chosen`` are moved."""
    matched = {might.which[h]: (h, which) for h, which in agree.items()}
    groups, done = [], set(agree.values())
    for which in scene.all:
        left = [(unit, which) for unit in hear[which] if unit not in chosen]
        shape = scene.shape_of(which)
        if which in matched:
            h, other = matched[which]
            left += [(unit, other) for unit in hear[other] if unit in chosen]
            shape = might.shape[h]
        if left:
            groups.append(Group(shape, tuple(left), which))
        own = tuple((unit, which) for unit in hear[which] if unit in chosen)
        if own and which not in done:
            groups.append(Group(scene.shape_of(which), own, which, True))
    return groups
