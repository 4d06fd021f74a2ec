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
    """What fitted poses add to a map's worth, by what was known of them beforehand: how unlikely they are, and how much
    of what was possible the map leaves to them (Laplace's approximation of the evidence), which is not more than all.
    """
    number = errors.open
    pose = stands.now[number] + shared.shift[number]
    beforehand = [_beforehand(stands, int(one), at) for one, at in zip(number, pose, strict=True)]
    width = np.array([widths for _, widths in beforehand]).ravel()
    left = errors.poses / np.outer(width, width)
    shares = np.minimum(np.linalg.eigvalsh(left), 1.0)
    return float(0.5 * np.log(shares).sum() + sum(nats for nats, _ in beforehand))


def _beforehand(stands: Stands, number: int, pose: np.ndarray) -> tuple[float, np.ndarray]:
    """How much less likely than the likeliest one the ``pose`` (3,) of a stand was beforehand, in nats, and how widely
    it was spread, (3,): as stated, or where that is doubted somewhere about it, or where another unit should be.
    """
    away = pose - stands.stated
    away[:, 2] = wrapped(away[:, 2])
    if not stands.is_doubted[number]:
        sigma = np.maximum(stands.sigma[number], _EXACT)
        return float(-0.5 * ((away[number] / sigma) ** 2).sum()), sigma
    found = [(-_WRONG_NATS - float(far_pose_nats(away[number][None], _ELSEWHERE_NATS)[0]), FAR)]
    others = stands.fine[stands.fine != number]
    for other in others:
        sigma = np.maximum(stands.sigma[other], _TAPE)
        square = float(((away[other] / sigma) ** 2).sum())
        found.append((-_WRONG_NATS - np.log(len(others)) - 0.5 * square, sigma))
    return max(found, key=lambda one: one[0] - np.log(one[1]).sum())


def far_pose_nats(away: np.ndarray, most_nats: float) -> np.ndarray:
    """How much less likely a wrong pose is that is ``away`` (n, 3) from the stated one than one beside it, (n,), by
    ``most_nats`` at most.
    """
    return np.minimum(0.5 * ((away / FAR) ** 2).sum(axis=1), most_nats)


_WRONG_NATS = float(np.log(100.0))  # one stated pose of a hundred is wrong
FAR = np.array([0.5, 0.5, np.radians(30.0)])  # metres and radians: how far a wrong pose is mostly off
# Hardly one is anywhere else, but places of a room sound alike: a map with a unit 3 m off was worth 16 nats more.
_ELSEWHERE_NATS = 20.0
_TAPE = np.array([0.03, 0.03, np.radians(3.0)])  # metres and radians, to which a unit stands where another should


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
