"""How well a unit's plateaus fit the landmarks of others at a pose: in nats, over hearing what nobody else hears."""

from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.placement.landmarks import Landmarks
from noctule_mapper.placement.reflector_models import NEAR_M, NEW_SHARE, SPAN_M
from noctule_mapper.placement.unit_views import UnitView
from noctule_mapper.readings.angles import wrapped

_BLUNT_SHARE, _BLUNT = 0.07, 5.0  # directions so many times as far off: a neighbour's plateau ran into theirs
_FRAME_SHARE, _FRAME_SIGMA_RAD = 0.7, np.radians(3.0)  # new walls that stand square to the known ones
MOST_GAIN_NATS = 12.0
_CHUNK = 1500


@dataclass(frozen=True)
class Fit:
    """Poses (k, 3) with each plateau's score in nats (k, n), and their normal equations' information (k, 3, 3) and
    gradient (k, 3) at the landmarks (k, n) that explain the plateaus best; -1 where none does.
    """

    pose: np.ndarray
    nats: np.ndarray
    information: np.ndarray
    gradient: np.ndarray
    landmark: np.ndarray


@dataclass(frozen=True)
class Tolerance:
    """How far off poses may be that are compared: none where they are fitted."""

    position_m: float = 0.0
    heading_rad: float = 0.0


def gains(view: UnitView, crossings: np.ndarray, marks: Landmarks, poses: np.ndarray, off: Tolerance) -> np.ndarray:
    """What the plateaus gain by the landmarks at ``poses`` (k, 3), in nats (k,); ``crossings`` as of ``matched``."""
    parts = [poses[at : at + _CHUNK] for at in range(0, len(poses), _CHUNK)]
    return np.concatenate([_weighed(_densest(view, marks, part, off).ratio, crossings).sum(axis=1) for part in parts])


def matched(view: UnitView, crossings: np.ndarray, marks: Landmarks, poses: np.ndarray, off: Tolerance) -> Fit:
    """The same, and how ``poses`` are to be improved; each row of ``crossings`` (t, 3) is a plateau that is where the
    walls of two others cross.
    """
    at = _densest(view, marks, poses, off)
    at = replace(at, ratio=np.where(_is_second(at, marks), _NEVER_NATS, at.ratio))
    share = 1 / (1 + NEW_SHARE / (1 - NEW_SHARE) * np.exp(-np.clip(at.ratio, -50, 50)))
    rad2 = at.covariance[..., 0, 0] + view.direction_sigma_rad**2 + off.heading_rad**2
    m2 = at.covariance[..., 1, 1] + view.range_sigma_m**2 + off.position_m**2
    cross = at.covariance[..., 0, 1]
    inverse = np.stack([np.stack([m2, -cross], -1), np.stack([-cross, rad2], -1)], -2)
    weighed = (share / (rad2 * m2 - cross**2))[..., None, None] * inverse
    slopes_t = np.swapaxes(at.slopes, -1, -2)
    return Fit(
        pose=poses,
        nats=_weighed(at.ratio, crossings),
        information=(slopes_t @ weighed @ at.slopes).sum(axis=1),
        gradient=(slopes_t @ weighed @ at.error[..., None])[..., 0].sum(axis=1),
        landmark=np.where(share > 0.5, at.landmark, -1),
    )


def _is_second(at: "_Densest", marks: Landmarks) -> np.ndarray:
    """Plateaus whose landmark explains another plateau of the unit better, bool (k, n): a unit hears each only once,
    and what one place has heard is one landmark, be it a wall or a point.
    """
    heard = marks.group[at.landmark]
    same = heard[:, :, None] == heard[:, None, :]
    return (same & (at.ratio[:, None, :] > at.ratio[:, :, None])).any(axis=-1)


_NEVER_NATS = -50.0


def _weighed(ratio: np.ndarray, crossings: np.ndarray) -> np.ndarray:
    """The gain of each plateau; little of a corner whose walls are known as it is, or are as new: they imply it."""
    weight, known = np.ones(ratio.shape), ratio > _KNOWN_NATS
    for corner, first, second in crossings:
        implied = known[:, corner] == (known[:, first] & known[:, second])
        weight[implied, corner] = _IMPLIED_WEIGHT
    return weight * _gain(ratio)


_IMPLIED_WEIGHT = 0.2
_KNOWN_NATS = np.log(NEW_SHARE / (1 - NEW_SHARE))  # from which a landmark is likelier than a new reflector


def _gain(ratio: np.ndarray) -> np.ndarray:
    return np.minimum(np.logaddexp(np.log(NEW_SHARE), np.log1p(-NEW_SHARE) + ratio), MOST_GAIN_NATS)


@dataclass(frozen=True)
class _Densest:
    """Of each plateau at each pose (k, n) the landmark that explains it best, and the log of how much denser than a new
    one; its error in direction and range (k, n, 2), the error's slopes by the pose (k, n, 2, 3), and the landmark's
    covariance (k, n, 2, 2).
    """

    landmark: np.ndarray
    ratio: np.ndarray
    error: np.ndarray
    slopes: np.ndarray
    covariance: np.ndarray


def _densest(view: UnitView, marks: Landmarks, poses: np.ndarray, off: Tolerance) -> _Densest:
    off_rad, off_m, towards, across, covariance = _predicted(marks, view, poses)
    spread_rad2 = view.direction_sigma_rad**2 + off.heading_rad**2
    both, range_m2 = (
        covariance[:, :, None, 0, 1],
        covariance[:, :, None, 1, 1] + view.range_sigma_m**2 + off.position_m**2,
    )
    own_rad2 = covariance[:, :, None, 0, 0]
    density = np.log1p(-_BLUNT_SHARE) + _log_normal(off_rad, off_m, own_rad2 + spread_rad2, both, range_m2)
    if not off.heading_rad:
        blunt = _log_normal(off_rad, off_m, own_rad2 + _BLUNT**2 * spread_rad2, both, range_m2)
        density = np.logaddexp(density, np.log(_BLUNT_SHARE) + blunt)
    density += np.log(marks.chance)[:, None]
    best = density.argmax(axis=1)
    rows = np.arange(len(poses))[:, None]
    pick = (rows, best, np.arange(len(view))[None, :])
    slopes = np.zeros((*best.shape, 2, 3))
    slopes[..., 0, 2] = 1.0
    slopes[..., 0, :2], slopes[..., 1, :2] = across[rows, best], towards[rows, best]
    return _Densest(
        landmark=best,
        ratio=density[pick] - new_density(view, marks, poses),
        error=np.stack([off_rad[pick], off_m[pick]], axis=-1),
        slopes=slopes,
        covariance=covariance[rows, best],
    )


def _predicted(
    marks: Landmarks, view: UnitView, poses: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """How far each plateau is off each landmark in direction and range, (k, marks, n); the slope of the range's by x
    and y, and of the direction's, (k, marks, 2); and the prediction's covariance (k, marks, 2, 2).
    """
    place = poses[:, None, :2]
    normal = np.stack([np.cos(marks.alpha_rad), np.sin(marks.alpha_rad)], axis=1)
    along_m = place[..., 0] * -normal[:, 1] + place[..., 1] * normal[:, 0]  # (k, w)
    wall_m = marks.rho_m - place[..., 0] * normal[:, 0] - place[..., 1] * normal[:, 1]
    of_walls = np.zeros((*along_m.shape, 2, 2))
    c = marks.wall_covariance
    of_walls[..., 0, 0] = c[:, 0, 0]
    of_walls[..., 0, 1] = of_walls[..., 1, 0] = c[:, 0, 1] - along_m * c[:, 0, 0]
    of_walls[..., 1, 1] = c[:, 1, 1] - 2 * along_m * c[:, 0, 1] + along_m**2 * c[:, 0, 0]
    way = marks.point[:, :2] - place  # (k, p, 2)
    away_m = np.maximum(np.hypot(way[..., 0], way[..., 1]), NEAR_M)
    scale, radius_m = marks.point[:, 2], marks.point[:, 3]
    towards = way / away_m[..., None]
    turned = np.stack([-towards[..., 1], towards[..., 0]], axis=-1)
    slopes = np.zeros((*away_m.shape, 2, 4))
    slopes[..., 0, :2], slopes[..., 1, :2] = turned / away_m[..., None], scale[:, None] * towards
    slopes[..., 1, 2], slopes[..., 1, 3] = away_m, -1.0
    of_points = np.einsum("kpai,pij,kpbj->kpab", slopes, marks.point_covariance, slopes)
    direction_rad = np.concatenate(
        [np.broadcast_to(marks.alpha_rad, wall_m.shape), np.arctan2(way[..., 1], way[..., 0])], axis=1
    )
    range_m = np.concatenate([wall_m, scale * away_m - radius_m], axis=1)
    off_rad = wrapped(poses[:, 2, None, None] + view.direction_rad - direction_rad[..., None])
    return (
        off_rad,
        view.range_m - range_m[..., None],
        np.concatenate([np.broadcast_to(normal, (len(poses), *normal.shape)), scale[:, None] * towards], axis=1),
        np.concatenate([np.zeros((len(poses), *normal.shape)), turned / away_m[..., None]], axis=1),
        np.concatenate([of_walls, of_points], axis=1),
    )


def _log_normal(a: np.ndarray, b: np.ndarray, aa: np.ndarray, ab: np.ndarray, bb: np.ndarray) -> np.ndarray:
    determinant = aa * bb - ab**2
    square = (bb * a**2 - 2 * ab * a * b + aa * b**2) / determinant
    return -0.5 * square - 0.5 * np.log(determinant) - np.log(2 * np.pi)


def new_density(view: UnitView, marks: Landmarks, poses: np.ndarray, of_group: np.ndarray | None = None) -> np.ndarray:
    """The log of how densely a new reflector's plateau lies in direction and range, (k, n): walls of a room tend to
    stand square to one another, so that a square one is no surprise. Plateaus that are ``of_group`` (n,) are not
    compared with their own.
    """
    direction_rad = poses[:, 2, None] + view.direction_rad
    square = wrapped(4 * (direction_rad[..., None] - marks.alpha_rad)) / 4
    sigma_rad = np.hypot(_FRAME_SIGMA_RAD, view.direction_sigma_rad)[None, :, None]
    near = np.exp(-0.5 * (square / sigma_rad) ** 2) / (4 * np.sqrt(2 * np.pi) * sigma_rad)
    walls = len(marks.alpha_rad)
    many = np.broadcast_to(marks.heard_by[:walls], near.shape)
    if of_group is not None:
        many = np.where(of_group[:, None] == marks.group[:walls], 0, many)
    frame = (near * many).sum(axis=-1) / np.maximum(many.sum(axis=-1), 1)
    return np.log(((1 - _FRAME_SHARE) / (2 * np.pi) + _FRAME_SHARE * frame) / SPAN_M)
