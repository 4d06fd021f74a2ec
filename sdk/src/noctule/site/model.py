"""A site: its units, where each is and what is known of its sensor."""

import math
from dataclasses import dataclass
from typing import Literal

from noctule import messages_pb2
from noctule.bounds import UNKNOWN_SIGMA_POSITION_M
from noctule.errors import SiteFileError
from noctule.messages_pb2 import SweepPlan


@dataclass(frozen=True)
class Pose2:
    """A place and heading in the site's frame, with standard deviations (position: along each axis)."""

    x_m: float
    y_m: float
    heading_rad: float
    sigma_position_m: float = 0.0
    sigma_heading_rad: float = 0.0

    def message(self) -> messages_pb2.Pose:
        """The pose as it stands in a Sweep."""
        return messages_pb2.Pose(
            x_m=self.x_m,
            y_m=self.y_m,
            heading_rad=self.heading_rad,
            sigma_position_m=self.sigma_position_m,
            sigma_heading_rad=self.sigma_heading_rad,
        )


@dataclass(frozen=True)
class FixedPose:
    """The unit stays where it is."""

    pose: Pose2


@dataclass(frozen=True)
class UnknownPose:
    """The unit stays where it is, and the mapper is to find out where that is."""

    def message(self) -> messages_pb2.Pose:
        """The unknown pose as it stands in a Sweep."""
        return Pose2(0.0, 0.0, 0.0, UNKNOWN_SIGMA_POSITION_M, math.pi).message()


@dataclass(frozen=True)
class WaypointPath:
    """The unit is carried along a path; the waypoint number that it reports indexes ``poses``."""

    poses: tuple[Pose2, ...]


@dataclass(frozen=True)
class PoseKey:
    """A tracker of the unit publishes its pose on the unit's pose key."""


PoseSource = FixedPose | UnknownPose | WaypointPath | PoseKey


@dataclass(frozen=True)
class Sensor:
    """What is known of a range sensor; None is not known. ``range_bias_m`` is the mean of measured minus true range.

    ``face_offset_m`` is from the axis about which the unit turns to the sensor's face. Where it is given the true range
    counts from the face, otherwise from the axis.
    """

    beam_width_rad: float | None = None
    range_bias_m: float | None = None
    range_sigma_m: float | None = None
    face_offset_m: float | None = None
    face_offset_sigma_m: float | None = None

    def message(self) -> messages_pb2.Sensor:
        """The sensor as it stands in a Sweep."""
        return messages_pb2.Sensor(
            beam_width_rad=self.beam_width_rad,
            range_bias_m=self.range_bias_m,
            range_sigma_m=self.range_sigma_m,
            face_offset_m=self.face_offset_m,
            face_offset_sigma_m=self.face_offset_sigma_m,
        )


@dataclass(frozen=True)
class Unit:
    """One unit: ``serial`` is what its HELLO must show, ``plan`` is None where the unit's own is to stand."""

    name: str
    serial: int
    address: str
    pose: PoseSource
    sensor: Sensor
    plan: SweepPlan | None
    start: bool
    pause_s: float
    room: str = ""  # where it is named, units of other named rooms don't hear it


@dataclass(frozen=True)
class Site:
    """One frame of coordinates and its units; ``clock`` is "unit" where units' time runs at another speed than UTC."""

    name: str
    units: tuple[Unit, ...]
    air_temperature_c: float | None
    clock: Literal["utc", "unit"]

    def unit(self, name: str) -> Unit:
        """The unit of that name; raises SiteFileError if there is none."""
        for unit in self.units:
            if unit.name == name:
                return unit
        known = ", ".join(unit.name for unit in self.units)
        raise SiteFileError(f"site {self.name!r} has no unit {name!r}: it has {known}")
