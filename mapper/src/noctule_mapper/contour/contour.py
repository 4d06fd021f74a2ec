"""The contour as the mapper knows it: walls, corners, cylinders, touches and units' poses, each with its covariance."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from noctule_mapper.contour.outline import Outline, outlines


@dataclass(frozen=True)
class Wall:
    """A wall on the line x cos(theta) + y sin(theta) = rho, seen from the side where the left-hand sum is smaller.

    ``start`` and ``end`` are (x_m, y_m), the room lying to the left of the way from one to the other; ``covariance`` is
    of (theta_rad, rho_m).
    """

    theta_rad: float
    rho_m: float
    start: tuple[float, float]
    end: tuple[float, float]
    covariance: np.ndarray
    readings: int
    # That it is a wall at all: 1 where two places determined it; below 1 for one that a single place heard and that a
    # right-angled frame tells from a corner and a cylinder.
    chance: float = 1.0

    @property
    def normal(self) -> np.ndarray:
        """Unit normal, out of the room, (2,)."""
        return np.array([np.cos(self.theta_rad), np.sin(self.theta_rad)])


@dataclass(frozen=True)
class Corner:
    """Where the ends of two walls meet; ``walls`` are their indices, ``covariance`` is of (x_m, y_m)."""

    x_m: float
    y_m: float
    covariance: np.ndarray
    walls: tuple[int, int]


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder; ``covariance`` is of (x_m, y_m, radius_m)."""

    x_m: float
    y_m: float
    radius_m: float
    covariance: np.ndarray
    readings: int


class PoseState(Enum):
    """What the room says of a unit's stated pose."""

    FITTED = "fitted"  # the stated pose is right to within its stated error; the fit knows it better
    OPEN = "open"  # in some direction the room tells less than was stated; there the pose is as stated
    WRONG = "wrong"  # off by more than the stated error allows; the pose is where the unit seems to be


@dataclass(frozen=True)
class UnitPose:
    """Where a unit that stands still is by the fit, and where it was stated to be.

    ``covariance`` (3, 3) is of the fitted (x_m, y_m, heading_rad). Units with ``fixes_frame`` are those whose stated
    poses are the best known ones: a single one fixes the site's frame, several fix it by their mean.
    """

    unit: str
    x_m: float
    y_m: float
    heading_rad: float
    covariance: np.ndarray
    stated_x_m: float
    stated_y_m: float
    stated_heading_rad: float
    stated_sigma_position_m: float
    stated_sigma_heading_rad: float
    state: PoseState = PoseState.FITTED
    fixes_frame: bool = False
    detail: str = ""  # a sentence for the operator, empty when all is well

    @property
    def is_wrong(self) -> bool:
        """Whether the stated pose cannot be right."""
        return self.state is PoseState.WRONG


@dataclass(frozen=True)
class Touch:
    """Where ``unit`` touched a reflector whose kind one place cannot tell: the foot of the echo and its covariance in
    (x_m, y_m); it answered over ``width_rad`` of the unit's turning.
    """

    x_m: float
    y_m: float
    covariance: np.ndarray
    unit: str
    readings: int
    width_rad: float
    direction_rad: float  # from the unit
    chance_wall: float  # the three sum to 1
    chance_corner: float
    chance_cylinder: float


@dataclass(frozen=True)
class Contour:
    """A site's contour from ``sweeps`` sweeps, the newest of ``time_s`` (since 1970 UTC)."""

    walls: tuple[Wall, ...] = ()
    corners: tuple[Corner, ...] = ()
    cylinders: tuple[Cylinder, ...] = ()
    touches: tuple[Touch, ...] = ()
    poses: tuple[UnitPose, ...] = ()  # of the units that sweep finely, where they stand now
    stops: tuple[UnitPose, ...] = ()  # where these units stood before, as they came there
    sweeps: int = 0
    time_s: float = 0.0
    method: str = ""
    range_sigma_m: float = field(default=float("nan"))  # the spread of a range that the fit went by
    note: str = ""  # why there is nothing, or no more

    def outlines(self) -> list[Outline]:
        """The walls that meet, as rings and open chains of points."""
        return outlines(
            [(wall.start, wall.end) for wall in self.walls],
            [(corner.x_m, corner.y_m, corner.walls) for corner in self.corners],
        )

    def shifted(self, x_m: float, y_m: float) -> "Contour":
        """The same contour seen from an origin that lies at (-x_m, -y_m); a wall's rho and its covariance go along."""
        return replace(
            self,
            walls=tuple(_shifted(wall, x_m, y_m) for wall in self.walls),
            corners=tuple(replace(one, x_m=one.x_m + x_m, y_m=one.y_m + y_m) for one in self.corners),
            cylinders=tuple(replace(one, x_m=one.x_m + x_m, y_m=one.y_m + y_m) for one in self.cylinders),
            poses=tuple(_shifted_pose(one, x_m, y_m) for one in self.poses),
            stops=tuple(_shifted_pose(one, x_m, y_m) for one in self.stops),
            touches=tuple(replace(one, x_m=one.x_m + x_m, y_m=one.y_m + y_m) for one in self.touches),
        )


def joined(contours: Sequence[Contour]) -> Contour:
    """The contours of a site's parts as one, the spread of a range the median of theirs."""
    walls, corners, cylinders, touches = [], [], [], []
    for one in contours:
        first = len(walls)
        corners += [replace(corner, walls=(corner.walls[0] + first, corner.walls[1] + first)) for corner in one.corners]
        walls += one.walls
        cylinders += one.cylinders
        touches += one.touches
    spreads_m = [one.range_sigma_m for one in contours if np.isfinite(one.range_sigma_m)]
    spread_m = float(np.median(spreads_m)) if spreads_m else float("nan")
    return Contour(
        tuple(walls),
        tuple(corners),
        tuple(cylinders),
        touches=tuple(touches),
        poses=tuple(pose for one in contours for pose in one.poses),
        stops=tuple(pose for one in contours for pose in one.stops),
        range_sigma_m=spread_m,
    )


def _shifted_pose(pose: UnitPose, x_m: float, y_m: float) -> UnitPose:
    return replace(
        pose,
        x_m=pose.x_m + x_m,
        y_m=pose.y_m + y_m,
        stated_x_m=pose.stated_x_m + x_m,
        stated_y_m=pose.stated_y_m + y_m,
    )


def _shifted(wall: Wall, x_m: float, y_m: float) -> Wall:
    """rho + x cos(theta) + y sin(theta): its error is that of rho and of theta at an arm along the wall."""
    by_old = np.array([[1.0, 0.0], [y_m * np.cos(wall.theta_rad) - x_m * np.sin(wall.theta_rad), 1.0]])
    return replace(
        wall,
        rho_m=wall.rho_m + float(wall.normal @ (x_m, y_m)),
        start=(wall.start[0] + x_m, wall.start[1] + y_m),
        end=(wall.end[0] + x_m, wall.end[1] + y_m),
        covariance=by_old @ wall.covariance @ by_old.T,
    )
