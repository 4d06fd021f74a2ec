"""How well the map is known, and how well it explains what units hear: figures over time."""

from collections.abc import Iterator, Mapping, Sequence
from math import sqrt
from statistics import median

import numpy as np

from noctule import poses, walls
from noctule.messages_pb2 import Contour
from noctule_viewer.board.heard_sweeps import HeardSweep

_NEAR_M = 0.10  # an echo farther from all that the map has is not explained by it
_SLACK_RAD = 0.05


def errors_mm(contour: Contour) -> dict[str, float]:
    """By kind the median of the standard deviations that the contour states: across walls at their middles, along the
    worse axis of corners, cylinders and poses. A kind that has none is left out.
    """
    found = {
        "walls": [sigma_m for wall in contour.walls if (sigma_m := walls.middle_sigma_m(wall)) is not None],
        "corners": [_worst_m(each.covariance, 2) for each in contour.corners if len(each.covariance) == 4],
        "cylinders": [_worst_m(each.covariance, 3) for each in contour.cylinders if len(each.covariance) == 9],
        "unit poses": [
            _worst_m(each.covariance, 3)
            for each in contour.poses
            if len(each.covariance) == 9 and poses.is_placed(each) and not each.fixes_frame
        ],
    }
    return {kind: 1e3 * median(sigmas_m) for kind, sigmas_m in found.items() if sigmas_m}


def residuals_m(contour: Contour, sweeps: Mapping[str, HeardSweep]) -> np.ndarray:
    """(echoes,) for each echo of ``sweeps``, by unit, its range minus the distance of what is nearest to it of all that
    ``contour`` has in the beam. NaN where that is nothing; units whose places are unknown are left out.
    """
    placed = {each.unit: (each.x_m, each.y_m, each.heading_rad) for each in contour.poses if poses.is_placed(each)}
    found = [np.zeros(0)]
    for unit, sweep in sweeps.items():
        pose = placed.get(unit, sweep.pose)
        if pose is not None:
            found.append(_of_unit(contour, sweep, pose))
    return np.concatenate(found)


def fit(residual_m: np.ndarray) -> dict[str, float]:
    """Of ``residual_m`` (echoes,): the share of echoes that the map explains, in percent, and their median distance
    from it, in millimetres. Empty without echoes.
    """
    if not len(residual_m):
        return {}
    explained_m = np.abs(residual_m[np.abs(residual_m) < _NEAR_M])
    distance = {"distance": 1e3 * float(np.median(explained_m))} if len(explained_m) else {}
    return {"explained": 100 * len(explained_m) / len(residual_m)} | distance


def _of_unit(contour: Contour, sweep: HeardSweep, pose: tuple[float, float, float]) -> np.ndarray:
    heard = np.isfinite(sweep.range_m)
    range_m = sweep.range_m[heard]
    direction_rad = pose[2] + sweep.bearing_rad[heard]
    candidates = [np.full(len(range_m), np.nan)]
    for distance_m, towards_rad in _echoers(contour, pose[:2]):
        off_rad = np.abs((direction_rad - towards_rad + np.pi) % (2 * np.pi) - np.pi)
        inside = off_rad <= sweep.beam_width_rad / 2 + _SLACK_RAD
        candidates.append(np.where(inside, range_m - distance_m, np.nan))
    return _least(np.stack(candidates))


def _least(candidates: np.ndarray) -> np.ndarray:
    """(echoes,) of (things, echoes) the one of the least size."""
    sizes = np.where(np.isnan(candidates), np.inf, np.abs(candidates))
    return candidates[sizes.argmin(axis=0), np.arange(candidates.shape[1])]


def _echoers(contour: Contour, place: Sequence[float]) -> Iterator[tuple[float, float]]:
    """Distance and direction (radians) of the foot on each wall, of each corner and of each cylinder's near side."""
    here = np.array(place)
    for wall in contour.walls:
        start, end = np.array([wall.start.x_m, wall.start.y_m]), np.array([wall.end.x_m, wall.end.y_m])
        length2 = float((end - start) @ (end - start))
        share = float((here - start) @ (end - start)) / length2 if length2 else 0.0
        if 0.0 <= share <= 1.0:
            yield _polar(start + share * (end - start) - here, 0.0)
    for corner in contour.corners:
        yield _polar(np.array([corner.x_m, corner.y_m]) - here, 0.0)
    for cylinder in contour.cylinders:
        yield _polar(np.array([cylinder.x_m, cylinder.y_m]) - here, cylinder.radius_m)


def _polar(way_m: np.ndarray, radius_m: float) -> tuple[float, float]:
    return float(np.hypot(*way_m)) - radius_m, float(np.arctan2(way_m[1], way_m[0]))


def _worst_m(covariance: Sequence[float], size: int) -> float:
    place = np.reshape(covariance, (size, size))[:2, :2]
    return sqrt(max(0.0, float(np.linalg.eigvalsh((place + place.T) / 2)[-1])))
