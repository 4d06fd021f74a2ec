"""What units whose poses are known hear of a room together: walls and points, each with what is known of it.

One place cannot tell a wall from a corner or a post, so a landmark heard from one place only is all of them, each with
its chance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.placement.reflector_models import Members, Models, PlacedUnit, Rows, all_models, rows_of

_LEAST_CHANCE = 0.002


@dataclass(frozen=True)
class Landmarks:
    """Walls (w,) on the lines x cos(alpha) + y sin(alpha) = rho, known from ``low_m`` to ``high_m`` along the tangent;
    and points (p, 4): x, y, and k and r of their ranges k d - r. ``group`` (w + p,) is the number of each landmark's
    group of plateaus, walls first; ``chance`` (w + p,) that the group was made by it, of 1; ``heard_by`` (w + p,) how
    many units heard each.
    """

    alpha_rad: np.ndarray
    rho_m: np.ndarray
    wall_covariance: np.ndarray  # (w, 2, 2) of (alpha, rho)
    low_m: np.ndarray
    high_m: np.ndarray
    point: np.ndarray
    point_covariance: np.ndarray  # (p, 4, 4)
    group: np.ndarray
    chance: np.ndarray
    heard_by: np.ndarray


def landmarks_of(units: Sequence[PlacedUnit], groups: Sequence[Members]) -> Landmarks:
    """The landmarks whose plateaus are ``groups``."""
    rows = rows_of(units, groups)
    walls, *points = all_models(rows)
    chance = chances([walls, *points])
    kept = [np.nonzero(each > _LEAST_CHANCE)[0] for each in chance]
    as_wall = kept[0]
    group = np.concatenate(kept)
    alpha_rad, rho_m = walls.value[as_wall].T
    low_m, high_m = extents(rows, walls)
    return Landmarks(
        alpha_rad=alpha_rad,
        rho_m=rho_m,
        wall_covariance=walls.covariance[as_wall],
        low_m=low_m[as_wall],
        high_m=high_m[as_wall],
        point=np.concatenate([one.value[at] for one, at in zip(points, kept[1:], strict=True)]),
        point_covariance=np.concatenate([one.covariance[at] for one, at in zip(points, kept[1:], strict=True)]),
        group=group,
        chance=np.concatenate([each[at] for each, at in zip(chance, kept, strict=True)]),
        heard_by=np.bincount(rows.group, minlength=len(groups))[group],
    )


def chances(models: Sequence[Models]) -> np.ndarray:
    """The chance of each kind, (kinds, g)."""
    evidence = np.array([one.log_evidence for one in models])
    odds = np.exp(evidence - evidence.max(axis=0, initial=-np.inf))
    return odds / odds.sum(axis=0)


def extents(rows: Rows, walls: Models) -> tuple[np.ndarray, np.ndarray]:
    """From where to where along its tangent each wall was touched, (g,)."""
    alpha_rad = walls.value[rows.group, 0]
    along_m = rows.place_m[:, 1] * np.cos(alpha_rad) - rows.place_m[:, 0] * np.sin(alpha_rad)
    low_m, high_m = np.full(len(walls.value), np.inf), np.full(len(walls.value), -np.inf)
    np.minimum.at(low_m, rows.group, along_m)
    np.maximum.at(high_m, rows.group, along_m)
    return low_m, high_m
