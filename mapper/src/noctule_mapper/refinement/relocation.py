"""Relocation: where a unit seems to be, by what it hears of reflectors that others have found.

Two plateaus that two walls made, not parallel ones, tell a pose: each the heading, as its wall's normal less its own
bearing, and both together the place, where the ranges to the walls are what was heard. Every pair of plateaus and walls
whose headings agree is tried, and the pose taken in which most plateaus have a reflector where they were heard.
"""

from collections.abc import Sequence

import numpy as np

from noctule_mapper.contour.reflectors import Crossing, Line, Reflector
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.refinement.poses import far_pose_nats

Pose = np.ndarray  # (x_m, y_m, heading_rad)
_SIGMA_M, _SIGMA_RAD = 0.02, np.radians(2.0)  # of a pose from two plateaus, in range and in direction
_SAME_HEADING_RAD = np.radians(6.0)
_LEAST_SINE = 0.3  # of the angle between two walls that tell a place
_MARGIN_M = 0.3  # a wall may go on so far beyond its last foot
_MOST_POSES = 1500
_MOST_FAR_NATS = 3.0  # that a pose far from the stated one is the less likely when a unit is sought


def relocated(
    heard: Evidence, pose: Pose, reflectors: Sequence[Reflector | Crossing], least: float
) -> tuple[float, Pose] | None:
    """Where the unit seems to be whose plateaus are ``heard``, their directions as from ``pose``, and how many nats
    more these are worth there than at ``pose``; None where it is not more than ``least`` nats.
    """
    if not len(heard.echoes):
        return None
    walls = [one for one in reflectors if isinstance(one, Line)]
    if _most(heard).sum() - _gains(heard, pose, pose[None], reflectors)[0] <= least:
        return None
    tried = _poses(heard, pose, walls)
    if not len(tried):
        return None
    tried = np.concatenate([pose[None], tried])
    away = tried - pose
    away[:, 2] = wrapped(away[:, 2])
    gain = _gains(heard, pose, tried, reflectors) - far_pose_nats(away, _MOST_FAR_NATS)
    best = int(gain.argmax())
    more = float(gain[best] - gain[0])
    return (more, tried[best]) if more > least else None


def _poses(heard: Evidence, pose: Pose, walls: Sequence[Line]) -> np.ndarray:
    """Poses that two plateaus and two walls tell, (poses, 3)."""
    if len(walls) < 2 or len(heard.echoes) < 2:
        return np.zeros((0, 3))
    theta, rho = np.array([(one.theta_rad, one.rho_m) for one in walls]).T
    bearing, range_m = heard.echoes.axis_rad - pose[2], heard.echoes.range_m
    heading = wrapped(theta[None, :] - bearing[:, None])  # (plateaus, walls)
    a, i = (each.ravel() for each in np.indices(heading.shape))
    first, second = np.nonzero(np.triu(np.abs(wrapped(heading.ravel()[:, None] - heading.ravel()[None])), 1))
    sine = np.sin(theta[i[second]] - theta[i[first]])
    turned = wrapped(heading[a[second], i[second]] - heading[a[first], i[first]])
    good = (a[first] != a[second]) & (np.abs(sine) > _LEAST_SINE) & (np.abs(turned) < _SAME_HEADING_RAD)
    good = np.nonzero(good)[0]
    good = good[np.linspace(0, len(good) - 1, min(len(good), _MOST_POSES)).astype(int)]
    first, second, turned = first[good], second[good], turned[good]
    i, j, a, b = i[first], i[second], a[first], a[second]
    ahead_i, ahead_j = rho[i] - range_m[a], rho[j] - range_m[b]  # n . p of both
    sine = np.sin(theta[j] - theta[i])
    x = (ahead_i * np.sin(theta[j]) - ahead_j * np.sin(theta[i])) / sine
    y = (ahead_j * np.cos(theta[i]) - ahead_i * np.cos(theta[j])) / sine
    return np.column_stack([x, y, wrapped(heading[a, i] + turned / 2)])


def _gains(heard: Evidence, pose: Pose, tried: np.ndarray, reflectors: Sequence[Reflector | Crossing]) -> np.ndarray:
    """What the plateaus are worth over any range and direction, in nats, at each pose ``tried``; (poses,)."""
    echoes = heard.echoes
    places = echoes.take(np.zeros(len(tried), int))
    places = type(places)(**{**vars(places), "x_m": tried[:, 0], "y_m": tried[:, 1]})
    (sigma_m, sigma_rad), most = _sigmas(heard), _most(heard)
    axis = echoes.axis_rad[None] + (tried[:, 2] - pose[2])[:, None]
    best = np.zeros((len(tried), len(echoes)))
    for one in reflectors:
        away = (echoes.range_m[None] - one.ranges(places)[:, None]) / sigma_m
        turn = wrapped(axis - one.directions(places)[:, None]) / sigma_rad
        gain = most - 0.5 * away**2 - 0.5 * turn**2
        if isinstance(one, Line):
            along = one.along(places)
            gain[(along < one.low_m - _MARGIN_M) | (along > one.high_m + _MARGIN_M)] = 0.0
        best = np.maximum(best, gain)
    return best.sum(axis=1)


def _sigmas(heard: Evidence) -> tuple[np.ndarray, np.ndarray]:
    return np.hypot(heard.range_sigma_m, _SIGMA_M), np.hypot(heard.direction_sigma_rad, _SIGMA_RAD)


def _most(heard: Evidence) -> np.ndarray:
    """What a plateau is worth whose reflector is just where it was heard, in nats, (plateaus,)."""
    sigma_m, sigma_rad = _sigmas(heard)
    return np.log(heard.span_m / (sigma_m * np.sqrt(2 * np.pi))) + np.log(np.sqrt(2 * np.pi) / sigma_rad)
