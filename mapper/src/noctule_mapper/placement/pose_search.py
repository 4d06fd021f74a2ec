"""All poses at which a unit's view fits the landmarks of others, and whether one of them stands out.

A wall that is a landmark gives the unit's heading and a line on which the unit stands. Poses along all such lines are
scored, the best are fitted, and what each one is worth is its score and the logarithm of its posterior's volume. So a
pose that slides along a corridor, or one of a rectangle's two, stands against its rivals with its whole weight.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.placement.landmarks import Landmarks, PlacedUnit
from noctule_mapper.placement.pose_scores import (
    Fit,
    Surroundings,
    Tolerance,
    gains,
    matched,
    silence_nats,
    ways_and_stubs,
)
from noctule_mapper.placement.unit_views import UnitView
from noctule_mapper.readings.angles import wrapped

_STEP_M = 0.12  # along the lines
_BEYOND_M = 1.0  # the landmarks
_COARSE = Tolerance(position_m=0.05, heading_rad=np.radians(2.0))
_STARTS = 60
_HOPELESS_NATS = 30.0  # below the best
_FIT_STEPS = 3
# Holds what the landmarks leave open where it is.
_HOLD = np.diag([1 / 0.2**2, 1 / 0.2**2, 1 / np.radians(5.0) ** 2])
_SAME_M, _SAME_RAD = 0.15, np.radians(6.0)
_IMPLIED_M, _IMPLIED_RAD, _IMPLIED_WEIGHT = 0.05, np.radians(6.0), 0.2


@dataclass(frozen=True, eq=False)  # of arrays
class Standing:
    """A pose (3,) at which a unit may stand, its covariance (3, 3), and its worth in nats: above 0 it is likelier than
    that the unit hears a place of which the others hear nothing.
    """

    pose: np.ndarray
    covariance: np.ndarray
    worth_nats: float


def standings(view: UnitView, marks: Landmarks, units: Sequence[PlacedUnit]) -> list[Standing]:
    """Where the unit may stand by the landmarks, distinct poses, the worthiest first."""
    starts = _along_walls(view, marks) if len(marks.alpha_rad) else np.zeros((0, 3))
    if not len(starts):
        return []
    weight, around = _weights(view), _surroundings(units)
    coarse_nats = gains(view, weight, marks, starts, _COARSE)
    hopeful = coarse_nats > coarse_nats.max() - _HOPELESS_NATS
    starts, nats = _best_of_cells(starts[hopeful], coarse_nats[hopeful])
    nats = nats - silence_nats(view, marks, around, starts)
    poses = starts[_distinct(starts, nats, _STARTS)]
    for _ in range(_FIT_STEPS):
        fit = matched(view, weight, marks, poses, Tolerance())
        poses = poses - np.linalg.solve(fit.information + _HOLD, fit.gradient[..., None])[..., 0]
    fit = matched(view, weight, marks, poses, Tolerance())
    nats = fit.nats.sum(axis=1) - silence_nats(view, marks, around, poses)
    volume = 1.5 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(fit.information + _HOLD)[1]
    worth = nats + volume
    best = int(worth.argmax())
    turned_worth = worth + _likeness_nats(fit, weight, best, marks)
    chosen = _distinct(poses, np.where(np.arange(len(poses)) == best, np.inf, turned_worth), len(poses))
    worth = turned_worth - _anywhere(marks)
    return [Standing(poses[at], np.linalg.inv(fit.information[at] + 1e-3 * _HOLD), float(worth[at])) for at in chosen]


def _likeness_nats(fit: Fit, weight: np.ndarray, best: int, marks: Landmarks) -> np.ndarray:
    """What poses turned by right angles from the best would gain, (k,), if the room looked from there as it looks from
    the best pose, as squares and rectangles do: what the others have not heard may be just as what they have.
    """
    walls = fit.landmark[best][(fit.landmark[best] >= 0) & (fit.landmark[best] < len(marks.alpha_rad)) & (weight == 1)]
    alpha_rad = marks.alpha_rad[walls]
    if (np.abs(wrapped(4 * (alpha_rad[:, None] - alpha_rad))) / 4 > _SQUARE_RAD).any():
        return np.zeros(len(fit.pose))
    turned_rad = wrapped(fit.pose[:, 2] - fit.pose[best, 2])
    square = (np.abs(wrapped(4 * turned_rad)) / 4 < _SAME_RAD) & (np.abs(turned_rad) > _SAME_RAD)
    shared = ((fit.landmark >= 0) & (weight == 1)).sum(axis=1)
    missed = np.maximum(fit.nats[best] - fit.nats - _LIKENESS_NATS, 0).sum(axis=1)
    return np.where(square & (shared >= _LEAST_SHARED), missed, 0)


_LEAST_SHARED = 2
_SQUARE_RAD = np.radians(9.0)  # one place tells the angle of two walls to 2 degrees
_LIKENESS_NATS = 1.5  # for each plateau: rooms are often squares and rectangles, or their parts are


def _along_walls(view: UnitView, marks: Landmarks) -> np.ndarray:
    """Poses (k, 3) at which a plateau's wall is a landmark, every so far along the wall."""
    low, high = _box(marks)
    reach_m = float(np.hypot(*(high - low)))
    along_m = np.arange(-reach_m / 2, reach_m / 2, _STEP_M)
    middle = (low + high) / 2
    alpha, plateau = (one.ravel() for one in np.meshgrid(np.arange(len(marks.alpha_rad)), np.arange(len(view))))
    normal = np.stack([np.cos(marks.alpha_rad[alpha]), np.sin(marks.alpha_rad[alpha])], axis=1)
    tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    foot = middle + (marks.rho_m[alpha] - view.range_m[plateau] - normal @ middle)[:, None] * normal
    places = foot[:, None] + along_m[:, None] * tangent[:, None]
    heading_rad = np.broadcast_to((marks.alpha_rad[alpha] - view.direction_rad[plateau])[:, None], places.shape[:2])
    poses = np.concatenate([places, heading_rad[..., None]], axis=-1).reshape(-1, 3)
    return poses[((poses[:, :2] > low) & (poses[:, :2] < high)).all(axis=1)]


def _box(marks: Landmarks) -> tuple[np.ndarray, np.ndarray]:
    """The corners of the box in which the unit may stand."""
    feet = [marks.point_m]
    normal = np.stack([np.cos(marks.alpha_rad), np.sin(marks.alpha_rad)], axis=1)
    tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    feet += [marks.rho_m[:, None] * normal + end[:, None] * tangent for end in (marks.low_m, marks.high_m)]
    all_m = np.concatenate(feet)
    return all_m.min(axis=0) - _BEYOND_M, all_m.max(axis=0) + _BEYOND_M


def _anywhere(marks: Landmarks) -> float:
    """What it is worth that the unit hears a place that no other unit hears: any pose, at a score of 0."""
    low, high = _box(marks)
    return float(np.log(np.prod(high - low) * 2 * np.pi))


def _weights(view: UnitView) -> np.ndarray:
    """1 for each plateau, less for one that is where two walls that the unit hears cross: the walls imply it."""
    weight = np.ones(len(view))
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
            implied[[first, second]] = False
            weight[implied] = _IMPLIED_WEIGHT
    return weight


def _surroundings(units: Sequence[PlacedUnit]) -> Surroundings:
    parts = [ways_and_stubs(one.view, one.pose[None]) for one in units]
    return Surroundings(*(np.concatenate([part[number][0] for part in parts]) for number in range(4)))


def _best_of_cells(poses: np.ndarray, worth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the poses in each cell of a grid the worthiest, and what it is worth."""
    cell = np.rint(poses / (_SAME_M, _SAME_M, _SAME_RAD)).astype(int)
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
        left = left[(apart_m > _SAME_M) | (turned_rad > _SAME_RAD)]
    return np.array(chosen, dtype=int)
