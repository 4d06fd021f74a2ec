"""Walls of a right-angled frame: what speaks against a frame, and the walls and corners that a good one is worth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.contour import Contour, Corner, Wall
from noctule_mapper.contour.corners import heard_through
from noctule_mapper.contour.reflectors import Crossing, Line
from noctule_mapper.contour.silence import silence_of_corner
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.refinement.frame_fit import FittedFrame, fit_frame
from noctule_mapper.refinement.pose_errors import ranges_by_sensor
from noctule_mapper.refinement.right_angles import SIDES, Frame, Heard

_SHORT_OF_SIGMAS = 3.0  # of a corner that is known too badly to be an end
_ALIKE_M, _ALIKE_RAD = 0.1, np.radians(6)  # a wall as near as this to another's line is no second wall


@dataclass(frozen=True)
class FrameWalls:
    """What a frame is worth, and the plateaus that it has used up, numbered as the place's."""

    walls: tuple[Wall, ...] = ()
    corners: tuple[Corner, ...] = ()
    used: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Support:
    """What one place heard: its plateaus, of how many ``readings`` each is (n,), each one's chance to be a ``wall`` or
    a ``corner`` of a frame (n,), and the covariance of its ``sensor`` (3, 3).
    """

    data: Evidence
    readings: np.ndarray
    wall: np.ndarray
    corner: np.ndarray
    sensor: np.ndarray

    @property
    def place_m(self) -> np.ndarray:
        """(2,)."""
        return np.array([self.data.echoes.x_m[0], self.data.echoes.y_m[0]])


def against(frame: Frame, place_m: np.ndarray, data: Evidence, config: RefinementConfig) -> float:
    """What the looks of ``data`` and its echoes from elsewhere say against a frame about ``place_m``, in nats: corners
    that stay silent, echoes from behind its walls, sides that the sweep passed and that nothing answers for.
    """
    heard = [number >= 0 for number in frame.walls]
    lines = [_line(frame, side, place_m) for side in range(SIDES)]
    price = config.touches.silent_side_nats * sum(
        not known and _passed(frame.turn_rad + side * np.pi / 2, place_m, data)
        for side, known in enumerate(~np.isnan(frame.distance_m))
    )
    for side in range(SIDES):
        other = (side + 1) % SIDES
        if np.isnan(frame.distance_m[[side, other]]).any():
            continue
        corner = Crossing(lines[side], lines[other])
        if frame.corners[side] < 0 and heard[side] and heard[other]:
            price += min(silence_of_corner(corner, data, config), config.touches.most_silent_corner_nats)
        elif frame.corners[side] >= 0:
            feet = [place_m + frame.distance_m[one] * lines[one].normal for one in (side, other) if heard[one]]
            price += config.prices.contradiction_nats * sum(
                heard_through(foot, corner.point, data, config) for foot in feet
            )
    return float(price)


def _line(frame: Frame, side: int, place_m: np.ndarray) -> Line:
    theta_rad = frame.turn_rad + side * np.pi / 2
    towards = np.array([np.cos(theta_rad), np.sin(theta_rad)])
    return Line(theta_rad, float(frame.distance_m[side] + towards @ place_m))


def _passed(direction_rad: float, place_m: np.ndarray, data: Evidence) -> bool:
    """Whether a sweep from the place looked in a direction."""
    if data.looks is None:
        return False
    looks = data.looks.echoes
    here = (looks.x_m == place_m[0]) & (looks.y_m == place_m[1])
    return bool((here & (np.abs(wrapped(looks.axis_rad - direction_rad)) < looks.step_rad / 2)).any())


@dataclass(frozen=True)
class _Fitted:
    """A frame as fitted: ``spread`` is the covariance of turn, four distances, x and y of the place, (7, 7), if the
    sensor were known, and ``whole`` with the sensor's error; its first ``known`` walls were known beforehand, what is
    numbered after them was heard by the place.
    """

    frame: Frame
    fit: FittedFrame
    spread: np.ndarray
    whole: np.ndarray
    known: int
    support: Support


def walls_of(frame: Frame, asked: Heard, support: Support, contour: Contour, config: RefinementConfig) -> FrameWalls:
    """The walls and corners of a frame that are sure enough and that ``contour`` has not got."""
    known = int(asked.known.sum())
    fit = fit_frame(frame, asked)
    sides = [
        side
        for side, number in enumerate(frame.walls)
        if number >= known and support.wall[number - known] >= config.touches.least_wall_chance
    ]
    spread = _spread(fit, support.data, alone=not any(0 <= number < known for number in frame.walls))
    own = np.array([number >= known for number in frame.walls])
    whole = spread + _by_sensor(fit, own, support.sensor)
    fitted = _Fitted(frame, fit, spread, whole, known, support)
    walls = {side: _wall(fitted, side, config) for side in sides}
    walls = {side: wall for side, wall in walls.items() if not any(_alike(wall, one) for one in contour.walls)}
    index = {side: len(contour.walls) + number for number, side in enumerate(walls)}
    corners, used = [], [frame.walls[side] - known for side in walls]
    for side in walls:
        other = (side + 1) % SIDES
        if other in walls and _ends(fitted, side, config):
            corners.append(_corner(fitted, side, (index[side], index[other])))
            used.append(frame.corners[side] - known)
    return FrameWalls(tuple(walls.values()), tuple(corners), frozenset(used))


def _spread(fit: FittedFrame, data: Evidence, alone: bool) -> np.ndarray:
    """Covariance of turn, four distances, x and y of the place, (7, 7); a frame that stands ``alone`` turns with the
    unit's heading.
    """
    whole = np.zeros((3 + SIDES, 3 + SIDES))
    whole[: 1 + SIDES, : 1 + SIDES] = fit.covariance
    whole[0, 0] += data.echoes.sigma_heading_rad[0] ** 2 if alone else 0.0
    whole[[5, 6], [5, 6]] = data.echoes.sigma_position_m[0] ** 2
    return whole


def _by_sensor(fit: FittedFrame, own: np.ndarray, sensor: np.ndarray) -> np.ndarray:
    """What the sensor's error adds to the spread: it moves all sides that the place heard, bool (4,), together."""
    by_sensor = np.zeros((3 + SIDES, 3))
    by_sensor[1 : 1 + SIDES] = own[:, None] * ranges_by_sensor(fit.distance_m)
    return by_sensor @ sensor @ by_sensor.T


def _ends(fitted: _Fitted, side: int, config: RefinementConfig) -> bool:
    """Whether the corner from a side to the next was heard and is known well enough to be an end of walls."""
    if not _heard(fitted, side, config):
        return False
    slopes = _corner_slopes(side, fitted.fit)
    return bool(np.sqrt(np.trace(slopes @ fitted.spread @ slopes.T)) <= config.touches.most_end_sigma_m)


def _heard(fitted: _Fitted, side: int, config: RefinementConfig) -> bool:
    """Whether the corner from a side to the next was surely heard."""
    number = fitted.frame.corners[side] - fitted.known
    return number >= 0 and bool(fitted.support.corner[number] >= config.touches.least_wall_chance)


def _wall(fitted: _Fitted, side: int, config: RefinementConfig) -> Wall:
    """Side ``side`` as a wall: to the corners that end it, else a little to both sides of the foot."""
    fit, support = fitted.fit, fitted.support
    theta_rad, number = fit.normal_rad(side), fitted.frame.walls[side] - fitted.known
    line = Line(theta_rad, float(fit.distance_m[side] + _unit(theta_rad) @ support.place_m))
    slopes = np.zeros((2, 3 + SIDES))
    slopes[0, 0] = 1
    slopes[1, [0, 1 + side]] = line.tangent @ support.place_m, 1
    slopes[1, 5:] = line.normal
    foot = float(line.tangent @ support.place_m)
    ends = []
    for corner, sign in (((side - 1) % SIDES, -1), (side, 1)):
        if _ends(fitted, corner, config):
            ends.append(_corner_point(corner, fit, support.place_m))
        else:
            seen_m = config.touches.foot_m
            if _heard(fitted, corner, config):  # as far towards the corner as the wall's line is known
                turn_sigma_rad = float(np.sqrt(fitted.spread[0, 0]))
                short_of_m = _SHORT_OF_SIGMAS * turn_sigma_rad * fit.distance_m[side]  # the foot's own error
                to_corner_m = float(fit.distance_m[(side + sign) % SIDES] - short_of_m)
                seen_m = max(seen_m, min(config.touches.most_end_sigma_m / turn_sigma_rad, to_corner_m))
            ends.append(line.at(foot + sign * seen_m))
    start, end = ((float(point[0]), float(point[1])) for point in ends)
    return Wall(
        theta_rad,
        line.rho_m,
        start,
        end,
        slopes @ fitted.whole @ slopes.T,
        int(support.readings[number]),
        float(support.wall[number]),
    )


def _corner(fitted: _Fitted, side: int, walls: tuple[int, int]) -> Corner:
    x_m, y_m = (float(each) for each in _corner_point(side, fitted.fit, fitted.support.place_m))
    slopes = _corner_slopes(side, fitted.fit)
    return Corner(x_m, y_m, slopes @ fitted.whole @ slopes.T, walls)


def _corner_point(side: int, fitted: FittedFrame, place_m: np.ndarray) -> np.ndarray:
    first, second = _unit(fitted.normal_rad(side)), _unit(fitted.normal_rad(side + 1))
    return place_m + fitted.distance_m[side] * first + fitted.distance_m[(side + 1) % SIDES] * second


def _corner_slopes(side: int, fitted: FittedFrame) -> np.ndarray:
    """Derivatives of a corner by turn, distances and place, (2, 7)."""
    first, second = _unit(fitted.normal_rad(side)), _unit(fitted.normal_rad(side + 1))
    near_m, far_m = fitted.distance_m[side], fitted.distance_m[(side + 1) % SIDES]
    slopes = np.zeros((2, 3 + SIDES))
    slopes[:, 0] = near_m * second - far_m * first
    slopes[:, 1 + side], slopes[:, 1 + (side + 1) % SIDES] = first, second
    slopes[:, 5:] = np.eye(2)
    return slopes


def _unit(theta_rad: float) -> np.ndarray:
    return np.array([np.cos(theta_rad), np.sin(theta_rad)])


def _alike(wall: Wall, other: Wall) -> bool:
    """Whether two walls are, or may well be, one: the same normal, and the same line at the first one's middle."""
    if abs(wrapped(np.array(wall.theta_rad - other.theta_rad))) > _ALIKE_RAD:
        return False
    middle = (np.array(wall.start) + wall.end) / 2
    return bool(abs(other.rho_m - other.normal @ middle) < _ALIKE_M)


def sides_known(walls: Sequence[Wall], place_m: np.ndarray) -> np.ndarray:
    """Direction, its variance, distance and its variance of walls as ``place_m`` sees them, (walls, 4)."""
    rows = []
    for wall in walls:
        tangent = np.array([-wall.normal[1], wall.normal[0]])
        slopes = np.array([-float(tangent @ place_m), 1.0])
        distance_m = wall.rho_m - float(wall.normal @ place_m)
        rows.append((wall.theta_rad, wall.covariance[0, 0], distance_m, float(slopes @ wall.covariance @ slopes)))
    return np.array(rows).reshape(-1, 4)
