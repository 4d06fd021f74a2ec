"""How well a fit knows the poses of the units that stand still, and what of that is the site's frame alone; how well
it knows their sensors.
"""

from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.readings.stands import Stands
from noctule_mapper.refinement.joint_fit import Normal, Shared

_EXACT = 1e-6  # metres or radians


@dataclass(frozen=True)
class Errors:
    """Covariances of the fit of ``open`` stands (k,): of their poses (3 k, 3 k) and of objects with poses
    (parameters, 3 k).

    ``frame`` (3 k, 3) makes of the poses' errors the turn and the shift of all of them together; None where an exact
    pose leaves no such freedom.
    """

    open: np.ndarray
    poses: np.ndarray
    with_objects: np.ndarray
    frame: np.ndarray | None

    def of(self, at: int) -> np.ndarray:
        """Of the pose of the stand ``open[at]``, (3, 3)."""
        return self.poses[3 * at : 3 * at + 3, 3 * at : 3 * at + 3]

    def held(self) -> np.ndarray:
        """Of the poses, if the frame were known, (3 k, 3 k)."""
        return self.poses - _by_frame(self.poses, self)

    def held_objects(self, covariance: np.ndarray) -> np.ndarray:
        """The ``covariance`` of the objects, (parameters, parameters), if the frame were known."""
        return covariance - _by_frame(self.with_objects, self)


def _by_frame(errors: np.ndarray, of: Errors) -> np.ndarray:
    """What of a covariance comes from the frame's error; ``errors`` (n, 3 k) is that of the n with the poses."""
    if of.frame is None or not len(of.open):
        return np.zeros((len(errors), len(errors)))
    together = errors @ of.frame
    return together @ np.linalg.solve(of.frame.T @ of.poses @ of.frame, together.T)


def with_sensors_left(normal: Normal, shared: Shared, parameters: int) -> np.ndarray:
    """The covariance of the objects, (parameters, parameters), with what no fit finds out of the sensors' mean errors:
    weak echoes come a little later than strong ones, so what corners tell of a mean error is not quite that of walls.
    """
    covariance = normal.covariance[:parameters, :parameters]
    if not len(shared.error):
        return covariance
    by_sensor = normal.covariance[:parameters, parameters:]
    by_sensor = np.linalg.solve(normal.covariance[parameters:, parameters:], by_sensor.T).T
    left = (_NEVER_FOUND * shared.sensor_sigma * (1, 0, 0)).ravel()
    return covariance + (by_sensor * left**2) @ by_sensor.T


def sensors_of(normal: Normal, stands: Stands, parameters: int) -> np.ndarray:
    """Covariance of each unit's sensor, (units, 3, 3): of its mean error, its share and its face's offset, with what no
    fit finds out of them.
    """
    covariance = np.zeros((len(stands.sensor_sigma), 3, 3))
    for number, unit in enumerate(np.nonzero(np.any(stands.sensor_sigma > 0, axis=1))[0]):
        at = parameters + 3 * number
        covariance[unit] = normal.covariance[at : at + 3, at : at + 3]
    covariance[:, 0, 0] += (_NEVER_FOUND * stands.sensor_sigma[:, 0]) ** 2
    return covariance


def ranges_by_sensor(range_m: np.ndarray) -> np.ndarray:
    """How ranges (n,) to what lies straight ahead move with the sensor's mean error, share and face, (n, 3)."""
    one = np.ones(len(range_m))
    return np.column_stack([one, range_m, -one])


def held_by(normal: Normal, stands: Stands, parameters: int) -> np.ndarray:
    """The covariance of the objects, (parameters, parameters), if the frame and the sensors were known."""
    by_sensor, sensors = normal.covariance[:, parameters:], normal.covariance[parameters:, parameters:]
    known = replace(normal, covariance=normal.covariance - by_sensor @ np.linalg.solve(sensors, by_sensor.T))
    return errors_of(known, stands, parameters).held_objects(known.covariance[:parameters, :parameters])


def with_poses_known(normal: Normal, parameters: int) -> np.ndarray:
    """The covariance of the objects, (parameters, parameters), if the poses and the sensors were known."""
    return np.linalg.inv(normal.own[:parameters, :parameters])


_NEVER_FOUND = 0.25  # of the sigma of a mean error that nobody has measured


def errors_of(normal: Normal, stands: Stands, parameters: int) -> Errors:
    """How well a fit knows the poses."""
    number = stands.open
    if not len(number):
        return Errors(number, np.zeros((0, 0)), np.zeros((parameters, 0)), None)
    spread = np.linalg.inv(normal.theirs[number])
    through = np.einsum("pgi,gij->pgj", normal.between[:, number], spread).reshape(len(normal.own), 3 * len(number))
    poses = through.T @ normal.covariance @ through
    for i, one in enumerate(spread):
        poses[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += one
    fine = stands.unit >= 0
    is_free = not np.any(fine & (stands.prior_sigma < _EXACT).all(axis=1))
    frame = _frame(stands.now[number], stands.prior_sigma[number]) if is_free else None
    return Errors(number, poses, -(normal.covariance @ through)[:parameters], frame)


def _frame(pose: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """The mean motion that best explains errors of poses (k, 3), each weighed by its stated sigma (k, 3): (3 k, 3)."""
    turning = np.zeros((len(pose), 3, 3))
    turning[:] = np.eye(3)
    turning[:, 0, 2], turning[:, 1, 2] = -pose[:, 1], pose[:, 0]
    motion = turning.reshape(-1, 3)
    weighed = motion / np.maximum(sigma.reshape(-1, 1), _EXACT) ** 2
    return weighed @ np.linalg.inv(motion.T @ weighed)
