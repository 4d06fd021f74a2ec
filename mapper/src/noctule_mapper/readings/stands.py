"""Stands: what all echoes from one pose, or of one unit, share and may have wrong.

A unit that stands still errs by (dx, dy, dheading) in all that it hears, however often it sweeps: its stated pose is
known to within its stated error. A coarse sweep has no directions, so of it only the place counts, and places that are
the same are one. The ranges of a unit err by a mean, the sensor's, and by a share, the air's, where nobody has measured
these.

The sensor's face stands off the unit's axis by a few centimetres, a: it is at p + a u(z), u the unit vector along the
beam's axis z. A range from the axis is the range from the face and a. To a wall at an angle b off the beam's axis an
error of a makes it false by 1 - cos(b) of that beside the mean error, which tells the two apart hardly at all.
"""

from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes

_DOUBTED = (1.0, 1.0, 1.0)  # metres and radians: the sigma of a stated pose that is probably wrong


@dataclass(frozen=True)
class Stands:
    """Poses (x_m, y_m, heading_rad), (stands, 3): ``stated``, how well known that is, and where the evidence has them
    ``now``; of the sensors the mean error, the share by which ranges are too long, and by how much the face stands
    farther off the axis than stated, (units, 3): how well known, and what has been taken off the evidence ``now``.

    ``unit`` (stands,) is the number of the unit, -1 for a place of coarse sweeps. ``known`` (stands, 2) is how well
    position and heading are known for telling which reflector made which echo, ``sensor_known`` (units, 3) the sensors.
    What is stated of a pose that ``is_doubted`` (stands,) says next to nothing.
    """

    unit: np.ndarray
    stated: np.ndarray
    sigma: np.ndarray
    is_doubted: np.ndarray
    now: np.ndarray
    known: np.ndarray
    sensor_sigma: np.ndarray
    sensor_now: np.ndarray
    sensor_known: np.ndarray

    @property
    def open(self) -> np.ndarray:
        """Numbers of the stands whose headings the fit estimates: fine ones whose pose is not exact."""
        return np.nonzero((self.unit >= 0) & (self.prior_sigma > 0).any(axis=1))[0]

    @property
    def fine(self) -> np.ndarray:
        """Numbers of the stands of fine sweeps."""
        return np.nonzero(self.unit >= 0)[0]

    @property
    def prior_sigma(self) -> np.ndarray:
        """Of the stated poses as the fit takes them, (stands, 3)."""
        return np.where(self.is_doubted[:, None], np.maximum(self.sigma, _DOUBTED), self.sigma)

    @property
    def may_move(self) -> bool:
        """Whether a fit may have other poses or sensors than the evidence."""
        return len(self.open) > 0 or bool(np.any(self.sensor_sigma[self.unit[self.unit >= 0]] > 0))


def stands_of(echoes: Echoes) -> tuple[Stands, np.ndarray]:
    """The stands of ``echoes``, where they are stated to be, and which stand each echo is of, (n,)."""
    _, first, of = np.unique(_keys(echoes), return_index=True, return_inverse=True)
    fine = echoes.is_fine[first]
    stated = np.column_stack([echoes.x_m, echoes.y_m, echoes.heading_rad])[first]
    position_m, heading_rad = echoes.sigma_position_m[first], np.where(fine, echoes.sigma_heading_rad[first], 0.0)
    units = int(echoes.unit.max(initial=-1)) + 1
    sensor_sigma = np.zeros((units, 3))
    own_sigma = np.column_stack([echoes.sigma_bias_m, echoes.sigma_scale, echoes.sigma_face_m])
    np.maximum.at(sensor_sigma, echoes.unit, own_sigma)
    stands = Stands(
        unit=np.where(fine, echoes.unit[first], -1),
        stated=stated,
        sigma=np.column_stack([position_m, position_m, heading_rad]),
        is_doubted=np.zeros(len(stated), bool),
        now=stated,
        known=np.column_stack([position_m, heading_rad]),
        sensor_sigma=sensor_sigma,
        sensor_now=np.zeros((units, 3)),
        sensor_known=sensor_sigma,
    )
    return stands, of.ravel()


def _keys(echoes: Echoes) -> np.ndarray:
    """A number that the echoes of one stand share, (n,)."""
    fine = echoes.is_fine
    place = _numbered(echoes.x_m + 1j * echoes.y_m)
    turn = _numbered(np.where(fine, echoes.unit + 1j * echoes.heading_rad, -1))
    return place * (int(turn.max(initial=0)) + 1) + turn


def _numbered(values: np.ndarray) -> np.ndarray:
    return np.unique(values, return_inverse=True)[1].ravel()


def moved(echoes: Echoes, stand: np.ndarray, before: Stands, after: Stands) -> Echoes:
    """Echoes of ``stand`` (n,) as they are with the poses and the sensors of ``after``, in place of those of
    ``before``.
    """
    shift = (after.now - before.now)[stand]
    bias_m, share, farther_m = (after.sensor_now - before.sensor_now)[echoes.unit].T
    sigma_bias_m, sigma_scale, sigma_face_m = after.sensor_known[echoes.unit].T
    face_m = echoes.face_offset_m + farther_m
    return replace(
        echoes,
        x_m=echoes.x_m + shift[:, 0],
        y_m=echoes.y_m + shift[:, 1],
        axis_rad=echoes.axis_rad + shift[:, 2],
        heading_rad=echoes.heading_rad + shift[:, 2],
        range_m=(echoes.range_m - echoes.face_offset_m - bias_m) / (1 + share) + face_m,
        face_offset_m=face_m,
        sigma_face_m=sigma_face_m,
        sigma_position_m=np.where(echoes.is_fine, after.known[stand, 0], echoes.sigma_position_m),
        sigma_heading_rad=np.where(echoes.is_fine, after.known[stand, 1], echoes.sigma_heading_rad),
        sigma_bias_m=sigma_bias_m,
        sigma_scale=sigma_scale,
    )


def with_sensors_as_now(stands: Stands) -> Stands:
    """The stands with sensors that are as the evidence has them, to within ``sensor_known``, whatever was stated."""
    return replace(stands, sensor_sigma=stands.sensor_known, sensor_now=np.zeros_like(stands.sensor_now))


def with_sensors_stated_as(before: Stands, after: Stands) -> Stands:
    """The stands ``after`` a search that began from with_sensors_as_now(``before``), with what was stated again."""
    return replace(after, sensor_sigma=before.sensor_sigma, sensor_now=before.sensor_now + after.sensor_now)


def deviation(stands: Stands) -> np.ndarray:
    """From where the evidence has the poses to where they are stated, (stands, 3)."""
    away = stands.stated - stands.now
    away[:, 2] = wrapped(away[:, 2])
    return away
