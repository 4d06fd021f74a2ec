"""What silence tells of an arrangement of units, in nats, whatever their order: each end of a wall and each point once,
and sound that went through walls.
"""

from collections.abc import Sequence

import numpy as np

from noctule_mapper.placement.landmarks import Landmarks
from noctule_mapper.placement.reflector_models import Members, PlacedUnit
from noctule_mapper.placement.silence import (
    STUB_M,
    THROUGH_NATS,
    WALL_SILENT,
    is_silent,
    point_at,
    point_silent,
    side,
    silent_beyond,
    unit_vector,
    ways_and_stubs,
)

_SURE_WALL = 0.5  # the chance from which sound does not go through


def joint_silence_nats(units: Sequence[PlacedUnit], groups: Sequence[Members], marks: Landmarks) -> float:
    """What it costs that units did not hear the landmarks ``marks`` of ``groups``, and heard things through walls."""
    chance, total = np.zeros(len(groups)), np.zeros(len(groups))
    np.add.at(chance, marks.group, marks.chance * _silent_chance(units, groups, marks))
    np.add.at(total, marks.group, marks.chance)
    of_landmarks = -np.log(chance[total > 0] / total[total > 0]).sum()
    return float(of_landmarks + THROUGH_NATS * _through_walls(units, marks))


def _silent_chance(units: Sequence[PlacedUnit], groups: Sequence[Members], marks: Landmarks) -> np.ndarray:
    """The chance of each landmark's silences, (w + p,). A wall ends before the first that did not hear it; one silence
    of a point makes the next likelier.
    """
    walls = len(marks.alpha_rad)
    deaf = np.ones((len(units), len(groups)), bool)
    for number, group in enumerate(groups):
        deaf[[unit for unit, _ in group], number] = False
    deaf = deaf[:, marks.group]
    normal, tangent = unit_vector(marks.alpha_rad), unit_vector(marks.alpha_rad + np.pi / 2)
    ends_m, inside, times = np.full((2, walls), np.inf), np.zeros(walls), np.zeros(len(marks.point))
    for one, misses in zip(units, deaf, strict=True):
        away_m = marks.rho_m - normal @ one.pose[:2]
        silent = is_silent(one.view, marks.alpha_rad - one.pose[2], away_m) & misses[:walls]
        along_m = tangent @ one.pose[:2]
        beyond_m = np.stack([marks.low_m - along_m, along_m - marks.high_m])
        ends_m = np.where(silent & (beyond_m > 0), np.minimum(ends_m, beyond_m), ends_m)
        inside += silent & (beyond_m <= 0).all(axis=0)
        bearing_rad, point_m = point_at(marks, one.pose[:2])
        times += is_silent(one.view, bearing_rad - one.pose[2], point_m) & misses[walls:]
    of_wall = silent_beyond(ends_m[0]) * silent_beyond(ends_m[1]) * WALL_SILENT[0] ** inside
    return np.concatenate([of_wall, point_silent(times, marks.heard_by[walls:])])


def _through_walls(units: Sequence[PlacedUnit], marks: Landmarks) -> int:
    """How many plateaus or walls must go, those first that are in most ways, until no sound went through a wall."""
    parts = [ways_and_stubs(one.view, one.pose[None]) for one in units]
    start, end, left, right = (np.concatenate([part[number][0] for part in parts]) for number in range(4))
    unit = np.repeat(np.arange(len(units)), [len(one.view) for one in units])
    foot, tangent = marks.rho_m[:, None] * unit_vector(marks.alpha_rad), unit_vector(marks.alpha_rad + np.pi / 2)
    long = (marks.high_m - marks.low_m > STUB_M) & (marks.chance[: len(foot)] > _SURE_WALL)
    wall_start = np.concatenate([left, (foot + marks.low_m[:, None] * tangent)[long]])
    wall_end = np.concatenate([right, (foot + marks.high_m[:, None] * tangent)[long]])
    a, b, ways = start[:, None], end[:, None], len(start)
    crossed = side(wall_start, wall_end, a) * side(wall_start, wall_end, b) < 0
    crossed &= side(a, b, wall_start) * side(a, b, wall_end) < 0
    crossed[:, :ways] &= unit[:, None] != unit
    gone = 0
    while crossed.any():
        in_way = crossed.sum(axis=0)
        in_way[:ways] += crossed.sum(axis=1)
        worst = int(in_way.argmax())
        crossed[:, worst] = False
        if worst < ways:
            crossed[worst] = False
        gone += 1
    return gone
