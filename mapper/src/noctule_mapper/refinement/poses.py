"""The poses of the units that stand still, as a fit has them, and what that says of the stated ones."""

from collections.abc import Sequence

import numpy as np

from noctule_mapper.contour.contour import PoseState, UnitPose
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.readings.stands import Stands
from noctule_mapper.refinement.em_fit import Settled
from noctule_mapper.refinement.joint_fit import Normal, Shared
from noctule_mapper.refinement.pose_errors import Errors

_TOLD = 2.0  # times as much as was stated beforehand the room must say of a pose, in each direction
_EXACT = 1e-6  # metres or radians


def squares(stands: Stands, shared: Shared, errors: Errors) -> np.ndarray:
    """How far each fitted pose lies from the stated one, squared and over the errors of both, (stands,): chi-square
    with 3 degrees of freedom where the stated poses are right. An exact one may err by what nobody can measure better.
    """
    away = stands.now + shared.shift - stands.stated
    away[:, 2] = wrapped(away[:, 2])
    found = np.zeros(len(away))
    for at, number in enumerate(errors.open):
        covariance = np.diag(np.maximum(stands.sigma[number], _BEST_STATED) ** 2)
        if stands.is_doubted[number]:  # otherwise the fit has been drawn to the stated pose already
            covariance = covariance + errors.of(at)
        found[number] = away[number] @ np.linalg.solve(covariance, away[number])
    return found


_BEST_STATED = (0.005, 0.005, np.radians(0.5))  # metres and radians


def stated_nats(stands: Stands, shared: Shared, errors: Errors) -> float:
    """What fitted poses add to a map's worth, beside the stated ones: how far they are off, and how much of what was
    stated to be possible the map leaves to them. Poses that are doubted tell nothing.
    """
    at = np.nonzero(~stands.is_doubted[errors.open])[0]
    number = errors.open[at]
    sigma = np.maximum(stands.sigma[number], _EXACT)
    away = (shared.shift - shared.stated)[number] / sigma
    rows = (3 * at[:, None] + np.arange(3)).ravel()
    left = errors.poses[np.ix_(rows, rows)] / np.outer(sigma, sigma)
    return float(0.5 * np.linalg.slogdet(left)[1] - 0.5 * (away**2).sum())


def unit_poses(data: Evidence, settled: Settled, units: Sequence[str]) -> tuple[UnitPose, ...]:
    """All poses from which units swept finely, as fitted."""
    stands, errors, shift = data.stands, settled.errors, settled.shared.shift
    told = _told(settled.normal, stands)
    chosen = np.intersect1d(data.stand, stands.fine)  # those that heard something
    least = stands.sigma[chosen].sum(axis=1).min(initial=np.inf)
    found = []
    for number in chosen:
        at = np.nonzero(errors.open == number)[0]
        pose = stands.now[number] + (shift[number] if len(at) else 0.0)
        state = PoseState.FITTED if told[number] else PoseState.OPEN
        (x_m, y_m, heading_rad), (stated_x_m, stated_y_m, stated_rad) = pose.tolist(), stands.stated[number].tolist()
        found.append(
            UnitPose(
                unit=units[int(stands.unit[number])],
                x_m=x_m,
                y_m=y_m,
                heading_rad=heading_rad,
                covariance=errors.of(int(at[0])) if len(at) else np.zeros((3, 3)),
                stated_x_m=stated_x_m,
                stated_y_m=stated_y_m,
                stated_heading_rad=stated_rad,
                stated_sigma_position_m=float(stands.sigma[number, 0]),
                stated_sigma_heading_rad=float(stands.sigma[number, 2]),
                state=PoseState.WRONG if stands.is_doubted[number] else state,
                fixes_frame=bool(stands.sigma[number].sum() <= least + _EXACT),
            )
        )
    return tuple(sorted(found, key=lambda one: one.unit))


def _told(normal: Normal, stands: Stands) -> np.ndarray:
    """Of which stands the room tells the pose, all others being where they are, bool (stands,): in each direction more
    than was stated. An exact pose needs no telling.
    """
    told = np.ones(len(stands.unit), bool)
    if not len(normal.theirs):
        return told
    own = np.linalg.inv(normal.own)
    for number in stands.open:
        sigma = np.maximum(stands.prior_sigma[number], _EXACT)
        between = normal.between[:, number]
        information = normal.theirs[number] - np.diag(1 / sigma**2) - between.T @ own @ between
        told[number] = np.linalg.eigvalsh(sigma[:, None] * information * sigma).min() > _TOLD
    return told
