"""The poses at which a unit's view fits the landmarks of others, each with what it is worth.

Poses at which two things agree that the unit and one other hear are scored and the best are fitted. What a pose is
worth is its score, what silence costs there, and the logarithm of its posterior's volume. So a pose that slides along a
corridor, or one of a rectangle's two, stands against its rivals with its whole weight.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.placement.landmarks import Landmarks, landmarks_of
from noctule_mapper.placement.pair_poses import pair_poses
from noctule_mapper.placement.pose_scores import Fit, Tolerance, gains, matched
from noctule_mapper.placement.reflector_models import PlacedUnit
from noctule_mapper.placement.silence import silence_nats, surroundings
from noctule_mapper.placement.unit_views import UnitView
from noctule_mapper.placement.wall_crossings import with_corners
from noctule_mapper.readings.angles import wrapped

_BEYOND_M = 1.0  # the landmarks
_COARSE = Tolerance(position_m=0.05, heading_rad=np.radians(2.0))
_TRIED = 120  # of the hopeful ones with what silence costs there
_STARTS = 40
_PAIR_STARTS = 60
_HOPELESS_NATS = 30.0  # below the best
_FIT_STEPS = 3
# Holds what the landmarks leave open where it is.
HOLD = np.diag([1 / 0.2**2, 1 / 0.2**2, 1 / np.radians(5.0) ** 2])
SAME_M, SAME_RAD = 0.15, np.radians(6.0)
TOGETHER_NATS = 2.0  # most units of a site stand in one room
# In random rooms a wall is heard by two units as often as not within 0.6 m along it, and ever more seldom beyond.
_NEAR_M, _FAR_NATS_PER_M, _MOST_FAR_NATS = 0.6, 1.1, 6.0
_IMPLIED_M, _IMPLIED_RAD = 0.05, np.radians(6.0)


@dataclass(frozen=True, eq=False)  # of arrays
class Standing:
    """A pose (3,) at which a unit may stand, its covariance (3, 3), and its worth in nats: above 0 it is likelier than
    that the unit hears a place of which the others hear nothing.
    """

    pose: np.ndarray
    covariance: np.ndarray
    worth_nats: float


def standings(view: UnitView, marks: Landmarks, units: Sequence[PlacedUnit], starts: np.ndarray) -> list[Standing]:
    """Where the unit may stand by the landmarks that ``units`` hear, near one of ``starts`` (k, 3): distinct poses, the
    worthiest first.
    """
    if not len(starts) or not len(marks.heard_by):
        return []
    away_nats, marks = anywhere(marks), with_corners(marks)
    crossings, around = crossings_of(view), surroundings(units, marks)

    def scored(poses: np.ndarray, off: Tolerance) -> tuple[Fit, np.ndarray]:
        fit = matched(view, crossings, marks, poses, off)
        silent_nats = silence_nats(view, marks, units, around, poses, fit.landmark)
        return fit, fit.nats.sum(axis=1) - _far_nats(fit, marks) - silent_nats

    starts, nats = _hopeful(view, crossings, marks, starts)
    starts = starts[np.argsort(-nats)[:_TRIED]]
    poses = starts[_distinct(starts, scored(starts, _COARSE)[1], _STARTS)]
    for _ in range(_FIT_STEPS):
        fit = matched(view, crossings, marks, poses, Tolerance())
        poses = poses - np.linalg.solve(fit.information + HOLD, fit.gradient[..., None])[..., 0]
    fit, nats = scored(poses, Tolerance())
    worth = nats + 1.5 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(fit.information + HOLD)[1]
    worth = worth - away_nats + TOGETHER_NATS
    covariance = np.linalg.inv(fit.information + 1e-3 * HOLD)
    return [Standing(poses[at], covariance[at], float(worth[at])) for at in _distinct(poses, worth, len(poses))]


def _far_nats(fit: Fit, marks: Landmarks) -> np.ndarray:
    """What it costs at the fitted poses, (k,), that walls are heard far beyond where others touched them."""
    walls = len(marks.alpha_rad)
    if not walls:
        return np.zeros(len(fit.pose))
    wall = np.clip(fit.landmark, 0, walls - 1)
    alpha_rad = marks.alpha_rad[wall]
    along_m = fit.pose[:, 1, None] * np.cos(alpha_rad) - fit.pose[:, 0, None] * np.sin(alpha_rad)
    beyond_m = np.maximum(marks.low_m[wall] - along_m, along_m - marks.high_m[wall])
    return np.where((fit.landmark >= 0) & (fit.landmark < walls), far_nats(beyond_m), 0).sum(axis=1)


def far_nats(beyond_m: np.ndarray) -> np.ndarray:
    """What it costs that a wall is heard so far beyond where others touched it."""
    return np.clip(_FAR_NATS_PER_M * (beyond_m - _NEAR_M), 0, _MOST_FAR_NATS)


def pair_starts(view: UnitView, of: UnitView) -> np.ndarray:
    """The most hopeful poses (k, 3) of the unit in the frame of another one, by what that one hears."""
    poses = pair_poses(of, view)
    if not len(poses):
        return poses
    alone = PlacedUnit(of, np.zeros(3), np.zeros((3, 3)))
    marks = landmarks_of([alone], [((0, plateau),) for plateau in range(len(of))])
    starts, nats = _hopeful(view, crossings_of(view), marks, poses)
    return starts[_distinct(starts, nats, _PAIR_STARTS)]


def _hopeful(
    view: UnitView, crossings: np.ndarray, marks: Landmarks, starts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Of ``starts`` that are alike the best, if it is not hopeless, and what it gains."""
    coarse_nats = gains(view, crossings, marks, starts, _COARSE)
    hopeful = coarse_nats > coarse_nats.max() - _HOPELESS_NATS
    return _best_of_cells(starts[hopeful], coarse_nats[hopeful])


def _box(marks: Landmarks) -> tuple[np.ndarray, np.ndarray]:
    """The corners of the box in which the unit may stand."""
    feet = [marks.point[:, :2]]
    normal = np.stack([np.cos(marks.alpha_rad), np.sin(marks.alpha_rad)], axis=1)
    tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    feet += [marks.rho_m[:, None] * normal + end[:, None] * tangent for end in (marks.low_m, marks.high_m)]
    all_m = np.concatenate(feet)
    return all_m.min(axis=0) - _BEYOND_M, all_m.max(axis=0) + _BEYOND_M


def anywhere(marks: Landmarks) -> float:
    """What it is worth that the unit hears a place that no other unit hears: any pose, at a score of 0."""
    low, high = _box(marks)
    return float(np.log(np.prod(high - low) * 2 * np.pi))


def crossings_of(view: UnitView) -> np.ndarray:
    """Plateaus that are where the walls of two others cross, (t, 3): the corner's number and the walls'."""
    found = []
    normal = np.stack([np.cos(view.direction_rad), np.sin(view.direction_rad)], axis=1)
    for first in range(len(view)):
        for second in range(first + 1, len(view)):
            sine = normal[first, 0] * normal[second, 1] - normal[first, 1] * normal[second, 0]
            if abs(sine) < 0.3:
                continue
            corner = np.linalg.solve(normal[[first, second]], view.range_m[[first, second]])
            away_m, bearing_rad = np.hypot(*corner), np.arctan2(corner[1], corner[0])
            implied = np.abs(view.range_m - away_m) < _IMPLIED_M + 0.03 * away_m
            implied &= np.abs(wrapped(view.direction_rad - bearing_rad)) < _IMPLIED_RAD
            implied &= view.range_m > view.range_m[[first, second]].max()  # no wall lies beyond its corners
            found += [(at, first, second) for at in np.nonzero(implied)[0]]
    return np.array(found, dtype=int).reshape(-1, 3)


def _best_of_cells(poses: np.ndarray, worth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the poses in each cell of a grid the worthiest, and what it is worth."""
    cell = np.rint(poses / (SAME_M, SAME_M, SAME_RAD)).astype(int)
    order = np.argsort(-worth)
    _, first = np.unique(cell[order], axis=0, return_index=True)
    return poses[order[first]], worth[order[first]]


def _distinct(poses: np.ndarray, worth: np.ndarray, most: int) -> np.ndarray:
    """Numbers of up to ``most`` poses (k, 3), the worthiest first, no two of them alike."""
    left, chosen = np.argsort(-worth), []
    while len(left) and len(chosen) < most:
        best, left = left[0], left[1:]
        chosen.append(best)
        apart_m = np.hypot(*(poses[left, :2] - poses[best, :2]).T)
        turned_rad = np.abs(wrapped(poses[left, 2] - poses[best, 2]))
        left = left[(apart_m > SAME_M) | (turned_rad > SAME_RAD)]
    return np.array(chosen, dtype=int)
