"""Corners lie where two walls cross that both end there, no matter which unit hears the corner or the walls."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.placement.landmarks import Landmarks, chances, extents
from noctule_mapper.placement.reflector_models import LEAST_SCALE, NEAR_M, NEW_SHARE, SPAN_M, Models, Rows, first_rows

CORNER_SIGMA_M = 0.002  # of a corner from where its walls cross
# Counted in random rooms with units at their true poses: corners that several units hear lie at a crossing of walls
# that some unit hears, 135 of 145; and where two sure walls cross and both may end there is a corner, 141 of 229.
_AT_CROSSING, _IS_CORNER = 0.9, 0.6
_LEAST_SINE = 0.3  # of the angle between two walls that make a corner
_ONE_SIDE_M = 0.1  # by which feet may lie beyond a wall's end
_ACUTE = -0.02  # the cosine of the walls' normals from which a corner is acute
_LEAST_CHANCE, _SURE_WALL = 0.05, 0.5
_MOST_NATS = 50.0


@dataclass(frozen=True)
class WallCrossings:
    """Where two walls cross and both may end: numbers of the walls (c, 2), their normals (c, 2, 2), the place (c, 2),
    the sine of the angle there, how well each wall is known there (c, 2), and whether the corner would be acute.
    """

    walls: np.ndarray
    normal: np.ndarray
    place_m: np.ndarray
    sine: np.ndarray
    variance_m2: np.ndarray
    is_acute: np.ndarray

    def __len__(self) -> int:
        return len(self.walls)


def wall_crossings(
    line: np.ndarray, covariance: np.ndarray, low_m: np.ndarray, high_m: np.ndarray, may_be: np.ndarray
) -> WallCrossings:
    """Of walls on ``line`` (w, 2), alpha and rho, with ``covariance`` (w, 2, 2), touched from ``low_m`` to ``high_m``
    (w,), those that ``may_be`` walls (w,).
    """
    number = np.nonzero(may_be)[0]
    walls = number[np.stack(np.triu_indices(len(number), 1), axis=1)]
    alpha_rad = line[walls, 0]
    normal = np.stack([np.cos(alpha_rad), np.sin(alpha_rad)], axis=-1)
    sine = normal[:, 0, 0] * normal[:, 1, 1] - normal[:, 0, 1] * normal[:, 1, 0]
    steep = np.abs(sine) > _LEAST_SINE
    walls, normal, sine = walls[steep], normal[steep], sine[steep]
    place_m = np.linalg.solve(normal, line[walls, 1][..., None])[..., 0]
    tangent = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
    along_m = np.einsum("cwi,ci->cw", tangent, place_m)
    # To which side of the crossing the wall goes on, where it is touched on one side only.
    is_end = (along_m < low_m[walls] + _ONE_SIDE_M) | (along_m > high_m[walls] - _ONE_SIDE_M)
    side = np.where(is_end, np.sign((low_m + high_m)[walls] / 2 - along_m), 0)
    is_convex = side[:, 0] * np.einsum("ci,ci->c", tangent[:, 0], normal[:, 1]) < 0
    of_wall = covariance[walls]
    variance_m2 = of_wall[..., 1, 1] - 2 * along_m * of_wall[..., 0, 1] + along_m**2 * of_wall[..., 0, 0]
    is_acute = is_convex & (np.einsum("ci,ci->c", normal[:, 0], normal[:, 1]) < _ACUTE)
    ends = (side != 0).all(axis=1)
    return WallCrossings(*(each[ends] for each in (walls, normal, place_m, sine, variance_m2, is_acute)))


def with_corners(marks: Landmarks) -> Landmarks:
    """The landmarks, and a corner at each crossing of sure walls, in groups of their own that nobody has heard."""
    walls = len(marks.alpha_rad)
    line = np.stack([marks.alpha_rad, marks.rho_m], axis=1)
    found = wall_crossings(line, marks.wall_covariance, marks.low_m, marks.high_m, marks.chance[:walls] > _SURE_WALL)
    if not len(found):
        return marks
    inverse = np.linalg.inv(found.normal)
    spread = found.variance_m2[:, None, :] * np.eye(2)
    covariance = np.tile(np.eye(4) * 1e-8, (len(found), 1, 1))
    covariance[:, :2, :2] = inverse @ spread @ np.swapaxes(inverse, 1, 2) + CORNER_SIGMA_M**2 * np.eye(2)
    k = np.where(found.is_acute, np.abs(found.sine), 1.0)
    return replace(
        marks,
        point=np.concatenate([marks.point, np.column_stack([found.place_m, k, np.zeros(len(found))])]),
        point_covariance=np.concatenate([marks.point_covariance, covariance]),
        group=np.concatenate([marks.group, marks.group.max() + 1 + np.arange(len(found))]),
        chance=np.concatenate([marks.chance, _IS_CORNER * marks.chance[found.walls].prod(axis=1)]),
        heard_by=np.concatenate([marks.heard_by, np.zeros(len(found), int)]),
    )


@dataclass(frozen=True)
class CornersAt:
    """Groups that are corners where two walls cross (c,), these walls' groups (c, 2), and by how many nats all groups
    are likelier so than as corners anywhere.
    """

    corner: np.ndarray
    walls: np.ndarray
    nats: float


def corners_at(rows: Rows, kinds: Sequence[Models]) -> CornersAt:
    """Which groups of plateaus are corners where others, as walls, cross; ``kinds`` are the groups as reflectors of
    each kind.

    Two walls that cross tell of a corner there, which is no new reflector where it is heard. Each crossing has one.
    """
    walls, *points = kinds
    chance = chances(kinds)
    found = wall_crossings(walls.value, walls.covariance, *extents(rows, walls), chance[0] > _LEAST_CHANCE)
    corner = np.nonzero(chance[1] + chance[2] > _LEAST_CHANCE)[0]
    anywhere = 1 - _AT_CROSSING * (chance[1] + chance[2])[corner]
    prior = chance[0][found.walls].prod(axis=1)
    likely = np.zeros((len(corner), len(found)))
    for kind, is_kind in enumerate((~found.is_acute, found.is_acute)):
        at = np.nonzero(is_kind)[0]
        nats = _nats(rows, walls, points[kind], corner, found, at)
        nats = np.minimum(nats + np.log(prior[at] * _IS_CORNER * (1 - NEW_SHARE) / NEW_SHARE), _MOST_NATS)
        own = (found.walls[at] == corner[:, None, None]).any(axis=-1)
        likely[:, at] = np.where(own, 0.0, chance[1 + kind][corner][:, None] * np.exp(nats))
    odds, chosen = likely / anywhere[:, None], []
    all_nats = np.log(anywhere)
    while odds.size and odds.max() > 1:
        one, crossing = np.unravel_index(int(odds.argmax()), odds.shape)
        all_nats[one] = np.log(anywhere[one] + likely[one, crossing])
        chosen.append((corner[one], *found.walls[crossing]))
        odds[one], odds[:, crossing] = 0, 0
        odds[np.isin(corner, found.walls[crossing])] = 0  # what is a wall here is no corner there
        odds[:, (found.walls == corner[one]).any(axis=1)] = 0
    groups = np.array(chosen, int).reshape(-1, 3)
    return CornersAt(groups[:, 0], groups[:, 1:], float(all_nats.sum()))


def _nats(
    rows: Rows, walls: Models, points: Models, corner: np.ndarray, found: WallCrossings, at: np.ndarray
) -> np.ndarray:
    """How much likelier groups ``corner`` (k,) are at the crossings ``at`` (c,) than anywhere, (k, c)."""
    value, covariance = points.value[corner], points.covariance[corner][:, :2, :2]
    normal = found.normal[at]
    off_m = np.einsum("cwi,ki->kcw", normal, value[:, :2]) - walls.value[found.walls[at], 1]
    spread = np.einsum("cwi,kij,cvj->kcwv", normal, covariance, normal)
    spread = spread + (found.variance_m2[at] + CORNER_SIGMA_M**2)[:, :, None] * np.eye(2)
    determinant = spread[..., 0, 0] * spread[..., 1, 1] - spread[..., 0, 1] ** 2
    square = (
        spread[..., 1, 1] * off_m[..., 0] ** 2
        - 2 * spread[..., 0, 1] * off_m[..., 0] * off_m[..., 1]
        + spread[..., 0, 0] * off_m[..., 1] ** 2
    ) / determinant
    away_m = np.maximum(np.hypot(*(value[:, :2] - rows.place_m[first_rows(rows)[corner]]).T), NEAR_M)
    volume = np.log(2 * np.pi * SPAN_M * away_m / np.maximum(value[:, 2], LEAST_SCALE))
    return (
        -0.5 * square - 0.5 * np.log(determinant) - np.log(2 * np.pi) + np.log(np.abs(found.sine[at])) + volume[:, None]
    )
