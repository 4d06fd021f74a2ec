"""The reflectors of the refinement: what range and direction each predicts for an echo, and how the range moves with
its parameters::

    wall      R = rho - n . p      the foot of the perpendicular
    cylinder  R = |c - p| - r
    point     R = |c - p|          a corner or an edge that stands alone
    corner    R = k |c - p|        at the crossing c of two walls; k = sin(a) for an interior angle a below 90 degrees,
                                   else 1

p is the sensor's face, a little off the unit's axis. Ranges count from the axis, so they have that offset in them.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from noctule_mapper.readings.echoes import Echoes


@dataclass(frozen=True)
class Line:
    """A wall: outward normal at ``theta_rad``, at ``rho_m`` from the origin, seen from ``low_m`` to ``high_m`` along
    (-sin, cos) theta.
    """

    theta_rad: float
    rho_m: float
    low_m: float = -np.inf
    high_m: float = np.inf

    @cached_property
    def normal(self) -> np.ndarray:
        """Out of the room, (2,)."""
        return np.array([np.cos(self.theta_rad), np.sin(self.theta_rad)])

    @cached_property
    def tangent(self) -> np.ndarray:
        """Along the wall, the room on the left, (2,)."""
        return np.array([-np.sin(self.theta_rad), np.cos(self.theta_rad)])

    @cached_property
    def box(self) -> np.ndarray:
        """Least x and y, most x and y, of what has been seen of it, (4,)."""
        ends = np.stack([self.at(self.low_m), self.at(self.high_m)])
        return np.concatenate([ends.min(axis=0), ends.max(axis=0)])

    @property
    def parameters(self) -> np.ndarray:
        """(theta_rad, rho_m)."""
        return np.array([self.theta_rad, self.rho_m])

    def moved(self, step: np.ndarray) -> "Line":
        """With ``step`` added to its parameters."""
        return Line(self.theta_rad + float(step[0]), self.rho_m + float(step[1]), self.low_m, self.high_m)

    def along(self, echoes: Echoes) -> np.ndarray:
        """Where along the wall the feet are, (n,)."""
        x_m, y_m = echoes.face_m
        return x_m * self.tangent[0] + y_m * self.tangent[1]

    def at(self, along_m: float) -> np.ndarray:
        """The point of the wall at ``along_m``, (2,)."""
        return self.rho_m * self.normal + along_m * self.tangent

    def ranges(self, echoes: Echoes) -> np.ndarray:
        """Predicted ranges, (n,)."""
        x_m, y_m = echoes.face_m
        return self.rho_m - x_m * self.normal[0] - y_m * self.normal[1] + echoes.face_offset_m

    def directions(self, echoes: Echoes) -> np.ndarray:
        """Directions in which the echoes come back, (n,)."""
        return np.full(len(echoes), self.theta_rad)

    def slopes(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the ranges by the parameters, (n, 2)."""
        return np.stack([-self.along(echoes), np.ones(len(echoes))], axis=1)

    def direction_slopes(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the directions by the parameters, (n, 2)."""
        return np.tile([1.0, 0.0], (len(echoes), 1))

    def direction_slopes_by_place(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the directions by the places of the echoes, (n, 2)."""
        return np.zeros((len(echoes), 2))

    def slopes_by_place(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the ranges by the places of the echoes, (n, 2)."""
        return np.tile(-self.normal, (len(echoes), 1))


@dataclass(frozen=True)
class Circle:
    """A cylinder about (x_m, y_m)."""

    x_m: float
    y_m: float
    radius_m: float

    @property
    def parameters(self) -> np.ndarray:
        """(x_m, y_m, radius_m)."""
        return np.array([self.x_m, self.y_m, self.radius_m])

    def moved(self, step: np.ndarray) -> "Circle":
        """With ``step`` added to its parameters."""
        return Circle(*(float(p) for p in self.parameters + step))

    def ranges(self, echoes: Echoes) -> np.ndarray:
        """Predicted ranges, (n,)."""
        return _distance_m(self.x_m, self.y_m, echoes) + echoes.face_offset_m - self.radius_m

    def directions(self, echoes: Echoes) -> np.ndarray:
        """Directions in which the echoes come back, (n,)."""
        return _direction_rad(self.x_m, self.y_m, echoes)

    def slopes(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the ranges by the parameters, (n, 3)."""
        direction = self.directions(echoes)
        return np.stack([np.cos(direction), np.sin(direction), -np.ones(len(echoes))], axis=1)

    def direction_slopes(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the directions by the parameters, (n, 3)."""
        return np.column_stack([_swing(self.x_m, self.y_m, echoes), np.zeros(len(echoes))])

    def direction_slopes_by_place(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the directions by the places of the echoes, (n, 2)."""
        return -_swing(self.x_m, self.y_m, echoes)

    def slopes_by_place(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the ranges by the places of the echoes, (n, 2)."""
        return -_towards(self.directions(echoes))


@dataclass(frozen=True)
class Spot:
    """A point that answers: a corner or an edge whose walls are not known."""

    x_m: float
    y_m: float

    @property
    def parameters(self) -> np.ndarray:
        """(x_m, y_m)."""
        return np.array([self.x_m, self.y_m])

    def moved(self, step: np.ndarray) -> "Spot":
        """With ``step`` added to its parameters."""
        return Spot(self.x_m + float(step[0]), self.y_m + float(step[1]))

    def ranges(self, echoes: Echoes) -> np.ndarray:
        """Predicted ranges, (n,)."""
        return _distance_m(self.x_m, self.y_m, echoes) + echoes.face_offset_m

    def directions(self, echoes: Echoes) -> np.ndarray:
        """Directions in which the echoes come back, (n,)."""
        return _direction_rad(self.x_m, self.y_m, echoes)

    def slopes(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the ranges by the parameters, (n, 2)."""
        direction = self.directions(echoes)
        return _towards(direction)

    def direction_slopes(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the directions by the parameters, (n, 2)."""
        return _swing(self.x_m, self.y_m, echoes)

    def direction_slopes_by_place(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the directions by the places of the echoes, (n, 2)."""
        return -_swing(self.x_m, self.y_m, echoes)

    def slopes_by_place(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the ranges by the places of the echoes, (n, 2)."""
        return -_towards(self.directions(echoes))


Reflector = Line | Circle | Spot


@dataclass(frozen=True)
class Crossing:
    """The corner where wall ``first`` ends and wall ``second`` starts; its parameters are theirs."""

    first: Line
    second: Line

    @cached_property
    def sine(self) -> float:
        """Of the angle by which the walls turn; positive where the corner is concave."""
        return float(np.sin(self.second.theta_rad - self.first.theta_rad))

    @cached_property
    def turn_rad(self) -> float:
        """By how much the walls turn, -pi to pi: pi less the interior angle."""
        return float(np.arctan2(self.sine, self.first.normal @ self.second.normal))

    @cached_property
    def point(self) -> np.ndarray:
        """(2,)."""
        (a, b), (c, d) = self.first.normal, self.second.normal
        first_m, second_m = self.first.rho_m, self.second.rho_m
        return np.array([d * first_m - b * second_m, a * second_m - c * first_m]) / (a * d - b * c)

    @cached_property
    def factor(self) -> float:
        """Range over distance to the point: the double bounce of an acute corner is shorter."""
        return self.sine if self._acute else 1.0

    @property
    def spread_rad(self) -> float:
        """How far off the corner's own direction an acute corner answers."""
        return float(np.pi / 2 - np.arcsin(self.sine)) if self._acute else 0.0

    def ranges(self, echoes: Echoes) -> np.ndarray:
        """Predicted ranges, (n,)."""
        x, y = self.point
        return self.factor * _distance_m(x, y, echoes) + echoes.face_offset_m

    def directions(self, echoes: Echoes) -> np.ndarray:
        """Directions of the corner's point, (n,)."""
        x, y = self.point
        return _direction_rad(x, y, echoes)

    def point_slopes(self) -> np.ndarray:
        """Derivatives of the point by (theta, rho) of the first wall and of the second, (2, 4)."""
        return self._point_slopes

    @cached_property
    def _point_slopes(self) -> np.ndarray:
        by_rho = np.linalg.inv(np.stack([self.first.normal, self.second.normal]))
        swing = [-float(wall.tangent @ self.point) for wall in (self.first, self.second)]
        return np.stack([swing[0] * by_rho[:, 0], by_rho[:, 0], swing[1] * by_rho[:, 1], by_rho[:, 1]], axis=1)

    def slopes(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the ranges by (theta, rho) of the first wall and of the second, (n, 4)."""
        direction = self.directions(echoes)
        slopes = self.factor * _towards(direction) @ self.point_slopes()
        if self._acute:
            x, y = self.point
            distance_m = _distance_m(x, y, echoes)
            turning = float(np.cos(self.second.theta_rad - self.first.theta_rad)) * distance_m
            slopes += np.outer(turning, [-1.0, 0.0, 1.0, 0.0])
        return slopes

    def direction_slopes(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the directions by (theta, rho) of the first wall and of the second, (n, 4)."""
        x, y = self.point
        return _swing(x, y, echoes) @ self.point_slopes()

    def direction_slopes_by_place(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the directions by the places of the echoes, (n, 2)."""
        x, y = self.point
        return -_swing(x, y, echoes)

    def slopes_by_place(self, echoes: Echoes) -> np.ndarray:
        """Derivatives of the ranges by the places of the echoes, (n, 2)."""
        return -self.factor * _towards(self.directions(echoes))

    @cached_property
    def _acute(self) -> bool:
        return self.sine > 0 and float(self.first.normal @ self.second.normal) < 0


def _away_m(x_m: float, y_m: float, echoes: Echoes) -> tuple[np.ndarray, np.ndarray]:
    """From each face to a point, x and y, (n,)."""
    face_x_m, face_y_m = echoes.face_m
    return x_m - face_x_m, y_m - face_y_m


def _distance_m(x_m: float, y_m: float, echoes: Echoes) -> np.ndarray:
    return np.hypot(*_away_m(x_m, y_m, echoes))


def _direction_rad(x_m: float, y_m: float, echoes: Echoes) -> np.ndarray:
    dx_m, dy_m = _away_m(x_m, y_m, echoes)
    return np.arctan2(dy_m, dx_m)


def _towards(direction_rad: np.ndarray) -> np.ndarray:
    """Unit vectors, (n, 2)."""
    return np.stack([np.cos(direction_rad), np.sin(direction_rad)], axis=1)


def _swing(x_m: float, y_m: float, echoes: Echoes) -> np.ndarray:
    """Derivatives of the directions of a point, seen from each face, by its coordinates, (n, 2)."""
    dx, dy = _away_m(x_m, y_m, echoes)
    square = np.maximum(dx**2 + dy**2, _AT_THE_PLACE_M2)
    return np.stack([-dy / square, dx / square], axis=1)


_AT_THE_PLACE_M2 = 1e-6  # a point at the very place has no direction


def box_of_rays(reflector: Reflector | Crossing, echoes: Echoes) -> np.ndarray:
    """Least x and y, most x and y, of the ways of ``echoes`` to the reflector, (4,); at least one echo."""
    predicted, direction = reflector.ranges(echoes), reflector.directions(echoes)
    start = np.stack([echoes.x_m, echoes.y_m], axis=1)
    touch = start + predicted[:, None] * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    ends = np.concatenate([start, touch])
    return np.concatenate([ends.min(axis=0), ends.max(axis=0)])
