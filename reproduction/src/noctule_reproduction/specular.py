"""A specular room: what an HC-SR04 hears in a polygon with cylinders in it, and which reflector made each echo.

A smooth wall answers from the foot of its perpendicular alone, a concave corner by double bounce, a reflex edge only
close by, a cylinder from its nearest point; the sensor reports the nearest of what lies inside its lobe and in plain
sight. It serves the reproduction of the paper and the tests; the mapper itself never imports it, shares nothing with it
but the type of a sweep, and is never told a label. It shares nothing with the firmware's simulator.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from noctule import bounds, messages_pb2
from noctule_mapper.readings.sweep import SweepReadings, speed_of_sound_m_s

HALF_BEAM_RAD = math.radians(11.25)  # as stated: Liu et al. 2019, Section II.A
BEARINGS_RAD = np.radians(np.arange(-135, 136, 22.5))  # Section VI
PAPER_SIGMA_M = 0.0032  # Section V.A
PAPER_BIAS_M = 0.0023  # Section V.A
SHORTEST_M, LONGEST_M = 0.02, 4.0
_NO_LONGER_HEARD_RAD = math.radians(130)  # a corner this wide answers no more
_LEAST_STATED_M = bounds.number("Sensor", "range_sigma_m").least  # a spread that a sweep may state
_BLIND_END_M = 1e-3  # of a line of sight, at the reflector itself
_FIRST_SWEEP_S = 1_767_225_600  # the first second of 2026; any would do


@dataclass(frozen=True)
class Room:
    """A closed polygon, its vertices (n, 2) anticlockwise, and cylinders (x, y, radius).

    Wall i runs from vertex i to the next; corner (or edge) i is vertex i, where wall i - 1 ends and wall i starts.
    """

    vertices: np.ndarray
    cylinders: tuple[tuple[float, float, float], ...] = ()

    @property
    def ends(self) -> np.ndarray:
        """The walls' second points, (n, 2)."""
        return np.roll(self.vertices, -1, axis=0)

    @cached_property
    def interior_rad(self) -> np.ndarray:
        """Angles inside the room at the vertices, (n,); above pi at a reflex edge."""
        before, after = self.vertices - np.roll(self.vertices, 1, axis=0), self.ends - self.vertices
        return np.pi - np.arctan2(_cross(before, after), (before * after).sum(axis=1))


@dataclass(frozen=True)
class Physics:
    """How a sensor and its carrier err. Shares are of the echoes; what is stated to the mapper is in the sweeps."""

    sigma_m: float = PAPER_SIGMA_M
    bias_m: float = 0.0  # mean error left in the ranges, unknown to the mapper
    face_offset_m: float = 0.0  # from the unit's axis, along the beam, to where ranges begin, unknown to the mapper
    range_scale: float = 1.0  # of the speed of sound that was assumed over the true one
    lobe: tuple[tuple[float, float], ...] = ((0.0, 11.25), (LONGEST_M, 11.25))  # range in metres, half-width in degrees
    edge_reach_m: float = 0.5
    cylinder_reach_m: float = 2.5  # of a cylinder with a radius of 9 cm
    cylinder_reach_power: float = 0.0  # the reach goes with this power of the radius
    late_share: float = 0.0
    late_m: float = 0.0043  # one cycle, 25 us, of sound there and back
    false_share: float = 0.0  # echoes whose range is anything from SHORTEST_M to LONGEST_M
    lost_share: float = 0.0
    sigma_position_m: float = 0.0  # along each axis, once for each place
    sigma_heading_rad: float = 0.0

    @cached_property
    def half_width_deg(self) -> PchipInterpolator:
        """The lobe's half-width in degrees by range in metres: smooth and monotone between what ``lobe`` gives."""
        range_m, half_width_deg = np.array(self.lobe).T
        return PchipInterpolator(range_m, half_width_deg)

    def reach_m(self, radius_m: float) -> float:
        """How far away a cylinder's axis may be."""
        return self.cylinder_reach_m * (radius_m / 0.09) ** self.cylinder_reach_power


# About 20 degrees close by, 9 to 10 from 0.5 to 1.5 m, narrower beyond. A cylinder's echo falls with the root of its
# radius and the 3/2 power of its distance, so that the reach goes with the radius' third root.
_LOBE_OF_HC_SR04 = ((0.0, 20.0), (0.3, 20.0), (0.5, 10.0), (1.5, 9.0), (LONGEST_M, 7.0))
PAPER = Physics()
PLAIN = Physics(lobe=_LOBE_OF_HC_SR04, cylinder_reach_m=2.0, cylinder_reach_power=1 / 3, late_share=0.02)
HARD = Physics(
    lobe=_LOBE_OF_HC_SR04,
    cylinder_reach_m=2.0,
    cylinder_reach_power=1 / 3,
    late_share=0.05,
    false_share=0.04,
    lost_share=0.08,
    sigma_position_m=0.004,
    sigma_heading_rad=math.radians(0.35),
)


class Label(NamedTuple):
    """What made a reading: wall, corner, edge or cylinder ``index`` of the room; -1 where it was none of them."""

    kind: Literal["wall", "corner", "edge", "cylinder", "false", "none"]
    index: int = -1


_NONE, _FALSE = Label("none"), Label("false")


@dataclass(frozen=True)
class LabelledSweep:
    """A sweep and the truth about it: what made each reading, by how much its range was late (n,), the range's spread,
    which the sweep itself states only where the sensor is calibrated.
    """

    sweep: SweepReadings
    labels: tuple[Label, ...]
    late_m: np.ndarray
    sigma_m: float


def paper_room() -> Room:
    """Tables II and III of the paper: corners E, D, C, B, A and the cylinder F."""
    corners = [(-1.145, -0.516), (0.717, -0.931), (2.200, -0.702), (2.585, 1.028), (-0.621, 1.833)]
    return Room(np.array(corners), ((1.384, 0.480, 0.448),))


def paper_path() -> np.ndarray:
    """The 44 poses (x, y, heading) of the rectangle (-0.70, -0.45) to (2.00, 1.05) walked in steps of 0.2 m, the last
    of a side shorter.
    """
    return walk(np.array([(-0.70, -0.45), (2.00, -0.45), (2.00, 1.05), (-0.70, 1.05)]), 0.2)


def walk(corners: np.ndarray, spacing_m: float) -> np.ndarray:
    """Poses (n, 3) along a closed path, heading along each side; a corner belongs to the side that begins there."""
    poses = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = end - start
        length = math.hypot(*along)
        heading = math.atan2(along[1], along[0])
        poses += [(*(start + along * (s / length)), heading) for s in np.arange(0, length - 1e-9, spacing_m)]
    return np.array(poses)


def survey_labelled(
    room: Room,
    poses: np.ndarray,
    rng: np.random.Generator,
    physics: Physics = PAPER,
    calibrated: bool = True,
    bearings_rad: np.ndarray = BEARINGS_RAD,
) -> list[LabelledSweep]:
    """One sweep with a reading at each of ``bearings_rad`` at each stated pose (n, 3), in order, 3 s apart. The true
    pose is the stated one and an error, the same whenever the unit is at the same place; ``calibrated`` sweeps state
    the range's spread.
    """
    _, visit = np.unique(poses[:, :2], axis=0, return_inverse=True)
    errors = np.zeros((int(visit.max(initial=-1)) + 1, 3))
    if physics.sigma_position_m or physics.sigma_heading_rad:
        spread = [physics.sigma_position_m, physics.sigma_position_m, physics.sigma_heading_rad]
        errors = rng.normal(0, 1, errors.shape) * spread
    true = poses + errors[visit.reshape(-1)]
    return [
        _labelled_sweep(room, stated, pose, number, rng, physics, calibrated, bearings_rad)
        for number, (stated, pose) in enumerate(zip(poses, true, strict=True))
    ]


def message_of(sweep: SweepReadings, air_temperature_c: float, bias_m: float = PAPER_BIAS_M) -> messages_pb2.Sweep:
    """The sweep as a gateway would send it: times of flight at ``air_temperature_c``, longer by the sensor's mean error
    ``bias_m``, which the message states, as it does the spread where the sweep has one.
    """
    number = sweep.identity[1]
    message = messages_pb2.Sweep(
        site="room", unit=sweep.unit, boot=1, sequence=number, air_temperature_c=air_temperature_c
    )
    message.start.FromNanoseconds(round((_FIRST_SWEEP_S + sweep.time_s) * 1e9))
    message.pose.x_m, message.pose.y_m, message.pose.heading_rad = sweep.x_m, sweep.y_m, sweep.heading_rad
    message.pose.sigma_position_m, message.pose.sigma_heading_rad = sweep.sigma_position_m, sweep.sigma_heading_rad
    message.sensor.beam_width_rad, message.sensor.range_bias_m = sweep.beam_width_rad, bias_m
    if sweep.range_sigma_m is not None:
        message.sensor.range_sigma_m = sweep.range_sigma_m
    for bearing_rad, range_m in zip(sweep.bearing_rad, sweep.range_m, strict=True):
        reading = message.readings.add(bearing_rad=bearing_rad)
        if math.isfinite(range_m):
            reading.time_of_flight_s = 2 * (range_m + bias_m) / speed_of_sound_m_s(air_temperature_c)
    return message


def _labelled_sweep(
    room: Room,
    stated: np.ndarray,
    pose: np.ndarray,
    number: int,
    rng: np.random.Generator,
    physics: Physics,
    calibrated: bool,
    bearings_rad: np.ndarray,
) -> LabelledSweep:
    true_m, labels = _heard_from_face(room, pose, bearings_rad, rng, physics)
    range_m = physics.range_scale * true_m + physics.bias_m + rng.normal(0, physics.sigma_m, len(true_m))
    range_m, labels, late_m = _disturbed(range_m, labels, rng, physics)
    sweep = SweepReadings(
        identity=("room", number),
        unit="u1",
        time_s=3.0 * number,
        x_m=float(stated[0]),
        y_m=float(stated[1]),
        heading_rad=float(stated[2]),
        sigma_position_m=physics.sigma_position_m,
        sigma_heading_rad=physics.sigma_heading_rad,
        bearing_rad=bearings_rad,
        range_m=range_m,
        no_echo=np.isnan(range_m),
        beam_width_rad=2 * HALF_BEAM_RAD,
        range_sigma_m=max(physics.sigma_m, _LEAST_STATED_M) if calibrated else None,
    )
    return LabelledSweep(sweep, tuple(labels), late_m, physics.sigma_m)


def _disturbed(
    range_m: np.ndarray, labels: list[Label], rng: np.random.Generator, physics: Physics
) -> tuple[np.ndarray, list[Label], np.ndarray]:
    """Some echoes late, some replaced by false ones, some lost; a disturbance that can't happen draws nothing."""
    late, false, lost = (
        rng.random(len(range_m)) < share if share else np.zeros(len(range_m), dtype=bool)
        for share in (physics.late_share, physics.false_share, physics.lost_share)
    )
    heard = np.isfinite(range_m)
    range_m = range_m + np.where(late, physics.late_m, 0)
    if physics.false_share:
        range_m = np.where(heard & false, rng.uniform(SHORTEST_M, LONGEST_M, len(range_m)), range_m)
    range_m = np.where(lost, np.nan, range_m)
    labels = [_FALSE if heard[i] and false[i] else label for i, label in enumerate(labels)]
    labels = [_NONE if lost[i] else label for i, label in enumerate(labels)]
    return range_m, labels, np.where(late & heard & ~false & ~lost, physics.late_m, 0.0)


def _heard_from_face(
    room: Room, pose: np.ndarray, bearings_rad: np.ndarray, rng: np.random.Generator, physics: Physics
) -> tuple[np.ndarray, list[Label]]:
    """As _heard(), from a face that goes round with the beam."""
    if not physics.face_offset_m:
        return _heard(room, pose, bearings_rad, rng, physics)
    range_m, labels = np.empty(len(bearings_rad)), []
    for number, bearing_rad in enumerate(bearings_rad):
        axis_rad = pose[2] + bearing_rad
        face = pose + physics.face_offset_m * np.array([math.cos(axis_rad), math.sin(axis_rad), 0.0])
        heard_m, (label,) = _heard(room, face, bearings_rad[number : number + 1], rng, physics)
        range_m[number] = heard_m[0]
        labels.append(label)
    return range_m, labels


def _heard(
    room: Room, pose: np.ndarray, bearings_rad: np.ndarray, rng: np.random.Generator, physics: Physics
) -> tuple[np.ndarray, list[Label]]:
    """Ranges at ``bearings_rad`` (n,), NaN where nothing answers, and what answered."""
    place, axis_rad = pose[:2], pose[2] + bearings_rad
    parts = [_feet(room, place), _corners(room, place, physics), _cylinders(room, place, physics)]
    labels = [label for part in parts for label in part[0]]
    range_m, touch = np.concatenate([part[1] for part in parts]), np.concatenate([part[2] for part in parts])
    answers = _corner_answers(room, len(axis_rad), rng)[:, [label.index for label in parts[1][0]]]
    may = np.ones((len(axis_rad), len(labels)), dtype=bool)
    may[:, len(parts[0][0]) : len(parts[0][0]) + answers.shape[1]] = answers
    off_axis = np.arctan2(*(touch - place).T[::-1])[None, :] - axis_rad[:, None]
    off_axis = np.abs((off_axis + np.pi) % (2 * np.pi) - np.pi)
    may &= off_axis <= np.radians(physics.half_width_deg(range_m))
    may &= (range_m > SHORTEST_M) & (range_m < LONGEST_M) & _in_sight(room, place, touch)
    by_range = np.where(may, range_m, np.inf)
    nearest = by_range.argmin(axis=1)
    least = by_range[np.arange(len(axis_rad)), nearest]
    heard = np.isfinite(least)
    return np.where(heard, least, np.nan), [labels[n] if ok else _NONE for n, ok in zip(nearest, heard, strict=True)]


_Part = tuple[Sequence[Label], np.ndarray, np.ndarray]  # labels, ranges (n,), points touched (n, 2)


def _feet(room: Room, place: np.ndarray) -> _Part:
    side = room.ends - room.vertices
    length = np.hypot(*side.T)
    along = side / length[:, None]
    s = ((place - room.vertices) * along).sum(axis=1)
    inside = np.nonzero((s >= 0) & (s <= length))[0]
    foot = (room.vertices + s[:, None] * along)[inside]
    return [Label("wall", int(i)) for i in inside], np.hypot(*(foot - place).T), foot


def _corners(room: Room, place: np.ndarray, physics: Physics) -> _Part:
    distance = np.hypot(*(room.vertices - place).T)
    reflex = room.interior_rad > np.pi
    factor = np.where(room.interior_rad < np.pi / 2, np.sin(room.interior_rad), 1.0)  # the double bounce
    near = np.nonzero(~reflex | (distance < physics.edge_reach_m))[0]
    labels = [Label("edge" if reflex[i] else "corner", int(i)) for i in near]
    return labels, (distance * factor)[near], room.vertices[near]


def _corner_answers(room: Room, readings: int, rng: np.random.Generator) -> np.ndarray:
    """Which corner answers in which reading, (readings, corners): ever fewer as the angle grows past 90 degrees."""
    chance = 1 - (room.interior_rad - np.pi / 2) / (_NO_LONGER_HEARD_RAD - np.pi / 2)
    rarely = (room.interior_rad >= np.pi / 2) & (room.interior_rad <= np.pi)
    answers = np.ones((readings, len(chance)), dtype=bool)
    answers[:, rarely] = rng.random((readings, int(rarely.sum()))) < chance[rarely]
    return answers


def _cylinders(room: Room, place: np.ndarray, physics: Physics) -> _Part:
    labels, ranges_m, touches = [], [], []
    for index, (x, y, radius) in enumerate(room.cylinders):
        towards = np.array([x, y]) - place
        distance = math.hypot(*towards)
        if radius < distance < physics.reach_m(radius):
            labels.append(Label("cylinder", index))
            ranges_m.append(distance - radius)
            touches.append(place + towards * (1 - radius / distance))
    return labels, np.array(ranges_m), np.array(touches).reshape(-1, 2)


def _in_sight(room: Room, place: np.ndarray, touch: np.ndarray) -> np.ndarray:
    """Between which of the points touched (n, 2) and the place nothing stands, (n,)."""
    way = touch - place
    way = way * (1 - _BLIND_END_M / np.maximum(np.hypot(*way.T), 2 * _BLIND_END_M))[:, None]
    side, offset = room.ends - room.vertices, room.vertices - place
    denominator = _cross(way[:, None], side[None])
    safe = np.where(np.abs(denominator) > 1e-12, denominator, np.inf)
    s, t = _cross(offset, side)[None] / safe, _cross(offset[None], way[:, None]) / safe
    hidden = (np.isfinite(safe) & (s > 0) & (s < 1) & (t >= 0) & (t <= 1)).any(axis=1)
    for x, y, radius in room.cylinders:
        towards = np.array([x, y]) - place
        nearest = np.clip((way @ towards) / (way**2).sum(axis=1), 0, 1)
        hidden |= np.hypot(*(towards - nearest[:, None] * way).T) < radius
    return np.logical_not(hidden)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
