"""Poses as part of the fit: stated by tape measure, wrong, exchanged; and sensors that nobody has measured."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mapper.fixed_units import (
    TAPE_M,
    TAPE_RAD,
    aligned,
    judge_fixed,
    room_can_tell,
    stated_by_tape,
    survey_fixed,
    taped_room,
)
from mapper.judge import corner_errors_m
from mapper.judged_poses import Taped, square
from mapper.judged_poses import taped as judged
from mapper.posed_label_fit import posed_label_fit
from mapper.room import LabelledSweep, Room, paper_path, paper_room, survey
from scipy.stats import chi2
from system.processes import two_processes

from noctule.messages_pb2 import Sweep
from noctule_mapper.config import LimitConfig, RefinementConfig, SensorConfig
from noctule_mapper.contour.contour import Contour, PoseState
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.echoes import echoes_of, join
from noctule_mapper.readings.evidence import evidence, with_stands
from noctule_mapper.readings.stands import Stands, deviation
from noctule_mapper.readings.sweep import from_message
from noctule_mapper.refinement.joint_fit import Shared
from noctule_mapper.refinement.pose_errors import Errors
from noctule_mapper.refinement.pose_rounds import known_as_fitted
from noctule_mapper.refinement.poses import stated_nats

# No room from these seeds on was ever looked at while the mapper was made.
FIRST_SEED, ROOMS, WRONG_ROOMS = 94_000, 40, 16
ROOM = Room(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]))
TRUE = np.array([(0.3, 0.6, 0.5), (3.7, 0.8, 2.6), (3.5, 2.6, -2.2), (0.6, 2.7, -0.9), (2.1, 0.3, 1.5)])
ERRORS = np.array(
    [(0.03, -0.02, 0.04), (-0.04, 0.01, -0.06), (0.01, 0.03, 0.02), (0.02, -0.03, 0.05), (0, 0.02, -0.03)]
)


def mapped(surveyed: list[LabelledSweep]) -> Contour:
    mapper = Mapper()
    for one in surveyed:
        mapper.register_sweep(one.sweep)
    return mapper.contour()


def taped(stated: np.ndarray, seed: int = 1) -> Contour:
    """The map of the room by units that are stated to be at ``stated``."""
    return mapped(stated_by_tape(survey_fixed(ROOM, TRUE, np.random.default_rng(seed)), stated))


def test_a_room_by_tape_measure_is_as_sharp_as_its_echoes() -> None:
    contour = aligned(taped(TRUE + ERRORS), ROOM, TRUE)
    assert len(contour.walls) == len(contour.corners) == 4
    # A range errs by 3.2 mm and each wall is heard some 40 times; the stated poses err by 3 cm and 3 degrees.
    assert corner_errors_m(contour, ROOM).max() < 0.015


def test_fitted_poses_are_better_than_stated_ones_and_none_is_called_wrong() -> None:
    contour = aligned(taped(TRUE + ERRORS), ROOM, TRUE)
    assert [pose.state for pose in contour.poses] == [PoseState.FITTED] * 5
    off_m = [np.hypot(pose.x_m - true[0], pose.y_m - true[1]) for pose, true in zip(contour.poses, TRUE, strict=True)]
    assert max(off_m) < TAPE_M / 2


@pytest.mark.parametrize("off", [(0.3, 0.0, 0.0), (-0.1, 0.28, 0.0), (0.0, 0.0, np.radians(20))])
def test_a_wrong_pose_is_named_with_where_the_unit_is(off: tuple[float, float, float]) -> None:
    contour = taped(TRUE + ERRORS + np.outer([0, 1, 0, 0, 0], off))
    assert [pose.unit for pose in contour.poses if pose.is_wrong] == ["u2"]
    wrong = aligned(contour, ROOM, TRUE).poses[1]
    assert np.hypot(wrong.x_m - TRUE[1, 0], wrong.y_m - TRUE[1, 1]) < 0.05
    assert not judge_fixed(aligned(contour, ROOM, TRUE), ROOM, []).false


def test_two_exchanged_units_are_named() -> None:
    contour = taped((TRUE + ERRORS)[[0, 4, 2, 3, 1]])
    assert [pose.unit for pose in contour.poses if pose.is_wrong] == ["u2", "u5"]


def test_one_unit_alone_keeps_its_stated_pose_and_says_that_the_room_cannot_tell() -> None:
    surveyed = stated_by_tape(survey_fixed(ROOM, TRUE[:1], np.random.default_rng(1)), TRUE[:1])
    (pose,) = mapped(surveyed).poses
    assert pose.state is PoseState.OPEN
    assert (pose.x_m, pose.y_m, pose.heading_rad) == pytest.approx(tuple(TRUE[0]), abs=1e-6)
    assert np.sqrt(np.diag(pose.covariance)) == pytest.approx((TAPE_M, TAPE_M, TAPE_RAD), rel=1e-3)


def test_the_unit_that_is_known_best_fixes_the_frame() -> None:
    surveyed = stated_by_tape(
        survey_fixed(ROOM, TRUE, np.random.default_rng(1)), TRUE + ERRORS * [[1], [1], [0], [1], [1]]
    )
    exact = {"sigma_position_m": 0.0, "sigma_heading_rad": 0.0}
    poses = mapped(
        [replace(one, sweep=replace(one.sweep, **exact)) if one.sweep.unit == "u3" else one for one in surveyed]
    ).poses
    assert [pose.unit for pose in poses if pose.fixes_frame] == ["u3"]
    assert not poses[2].covariance.any()
    # The others are where they are beside the exact one, without any alignment.
    assert all(
        square(pose, true) < chi2.ppf(1 - 1e-4, 3) for pose, true in zip(poses, TRUE, strict=True) if pose.unit != "u3"
    )


def test_units_with_exact_poses_are_where_they_are_stated_to_be() -> None:
    poses = mapped(survey_fixed(ROOM, TRUE, np.random.default_rng(1))).poses
    assert np.array([(pose.x_m, pose.y_m, pose.heading_rad) for pose in poses]) == pytest.approx(TRUE)
    assert all(pose.fixes_frame and not pose.covariance.any() for pose in poses)


def test_no_number_of_sweeps_makes_a_map_better_than_its_sensor() -> None:
    """A mean error of 3 mm that nobody has measured puts every wall of a room too far out, or in, alike."""
    rng = np.random.default_rng(3)
    sweeps = survey(paper_room(), np.tile(paper_path(), (20, 1)), rng)
    mapper = Mapper()
    for number, one in enumerate(sweeps):
        mapper.register_sweep(replace(one, identity=("log", number), sigma_bias_m=0.003))
    walls = mapper.contour().walls
    assert walls
    assert min(np.sqrt(np.trace(wall.covariance[1:, 1:])) for wall in walls) > 0.0005


def test_air_five_kelvin_off_is_found_out_by_units_whose_poses_are_exact() -> None:
    """Ranges 0.9 % too long, as by air of 25 degrees taken for 20: 3.5 cm at 4 m."""
    surveyed = survey_fixed(ROOM, TRUE, np.random.default_rng(1))
    assumed = [
        replace(one, sweep=replace(one.sweep, range_m=one.sweep.range_m * 1.0088, sigma_scale=0.0088))
        for one in surveyed
    ]
    contour = mapped(assumed)
    assert len(contour.corners) == 4
    assert corner_errors_m(contour, ROOM).max() < 0.015


def test_a_sweep_that_tells_neither_bias_nor_temperature_is_unsure_of_both() -> None:
    message = Sweep(unit="u1")
    message.pose.SetInParent()
    read = from_message(message)
    # 3 mm, and 5 K at 0.606 m/s/K of 343.4 m/s.
    assert (read.sigma_bias_m, read.sigma_scale) == pytest.approx((0.003, 5 * 0.606 / 343.42))
    message.air_temperature_c = 20
    message.sensor.range_bias_m = 0.002
    known = from_message(message)
    assert (known.sigma_bias_m, known.sigma_scale) == (0, 0)


def test_a_configured_bias_has_been_measured_and_the_face_stands_off_the_axis() -> None:
    message = Sweep(unit="u1", air_temperature_c=20)
    message.pose.SetInParent()
    message.readings.add(time_of_flight_s=2 / 343.42)
    read = from_message(message, SensorConfig(range_bias_m=0.0, face_offset_m=0.02, face_offset_sigma_m=0.005))
    assert read.range_m == pytest.approx([1.02])
    assert (read.sigma_bias_m, read.face_offset_m, read.face_offset_sigma_m) == (0, 0.02, 0.005)


def nats_of_the_first(away: tuple[float, float, float], is_doubted: bool, known_to: float = 1e-3) -> float:
    """What the pose of the first of three units, each stated by tape measure, adds to the worth of a map that knows all
    poses to ``known_to`` metres and radians, if it is ``away`` from its stated one.
    """
    units, sigma = np.arange(3), np.tile([TAPE_M, TAPE_M, TAPE_RAD], (3, 1))
    sensors = np.zeros((3, 3))
    stands = Stands(
        unit=units,
        stated=TRUE[:3],
        sigma=sigma,
        is_doubted=np.array([is_doubted, False, False]),
        now=TRUE[:3] + np.outer([1, 0, 0], away),
        known=sigma[:, 1:],
        sensor_sigma=sensors,
        sensor_now=sensors,
        sensor_known=sensors,
    )
    nothing, unmoved = np.zeros((0, 3)), np.zeros((3, 3))
    shared = Shared(units, deviation(stands), sigma, unmoved, units, nothing, nothing, nothing)
    return stated_nats(stands, shared, Errors(units, known_to**2 * np.eye(9), np.zeros((0, 9)), None))


@pytest.mark.parametrize(
    ("away", "spread", "likelihood"),
    [
        ((0.0, 0.0, 0.0), (0.5, 0.5, np.radians(30)), 1.0),
        ((0.3, 0.0, 0.0), (0.5, 0.5, np.radians(30)), np.exp(-0.5 * 0.6**2)),
        ((4.0, 0.0, 1.0), (0.5, 0.5, np.radians(30)), np.exp(-20.0)),
        (tuple(TRUE[1] - TRUE[0]), (TAPE_M, TAPE_M, TAPE_RAD), 1 / 2),
    ],
)
def test_a_wrong_pose_must_make_up_for_how_unlikely_it_was(
    away: tuple[float, float, float], spread: tuple[float, float, float], likelihood: float
) -> None:
    """By Bayes: a hundredth of the stated poses is wrong, and mostly by half a metre and 30 degrees, or the unit stands
    where one of the two others should. Against the pose as stated it is the less likely, the wider it may be spread.
    """
    spreads = np.prod(spread) / (TAPE_M**2 * TAPE_RAD)
    more = nats_of_the_first(away, is_doubted=True) - nats_of_the_first((0.0, 0.0, 0.0), is_doubted=False)
    assert more == pytest.approx(np.log(likelihood / 100 / spreads))


def test_a_map_that_tells_nothing_of_a_wrong_pose_gains_nothing_by_that() -> None:
    assert nats_of_the_first((0.0, 0.0, 0.0), is_doubted=True, known_to=2.0) == pytest.approx(-np.log(100))


@pytest.mark.parametrize("seed", [5014, 5074])
def test_no_map_is_made_that_suits_the_stated_poses_better_than_the_echoes(seed: int) -> None:
    """Rooms in which other walls than the true ones explain the echoes nearly as well. In the one a wrong map was kept
    though with the poses that it needed it explained hardly anything, in the other all was added before any pose was
    known, which led astray.
    """
    room, true, surveyed = taped_room(np.random.default_rng(seed))
    told = posed_label_fit(room, surveyed, true).room
    verdict = judge_fixed(aligned(mapped(surveyed), room, true), room, surveyed, told)
    assert len(verdict.due) > 4
    assert (verdict.missed, verdict.false) == ((), ())


@pytest.mark.parametrize("seed", [71074, 71128])
def test_two_units_make_no_wall_of_a_corner_that_both_hear(seed: int) -> None:
    """In the one room ranges agreed only as far as the poses were known beforehand; in the other late echoes parted the
    corner's plateaus, and each half counted.
    """
    room, true, surveyed = taped_room(np.random.default_rng(seed), 2)
    told = posed_label_fit(room, surveyed, true).room
    verdict = judge_fixed(aligned(mapped(surveyed), room, true), room, surveyed, told)
    assert len(verdict.due) > 1
    assert (verdict.missed, verdict.false) == ((), ())


def test_what_poses_may_have_wrong_excuses_no_range_once_they_are_fitted() -> None:
    surveyed = stated_by_tape(survey_fixed(ROOM, TRUE[:1], np.random.default_rng(1)), TRUE[:1])
    echoes = join([echoes_of(one.sweep, number, 0.0032) for number, one in enumerate(surveyed)])
    stated = evidence(echoes, echoes.sigma_m, 4.0, RefinementConfig())
    fitted = with_stands(stated, known_as_fitted(stated.stands))
    residual_m = np.full(len(echoes), 0.02)
    # 2 cm are less than a tape's 3, but six times what a range errs by: 18 nats, of 6.2 that it could gain.
    assert (stated.gain(residual_m) > 5).all()
    assert (fitted.gain(residual_m) < -8).all()


def test_a_wall_whose_feet_are_one_spot_goes_on_no_farther_than_its_far_corner() -> None:
    """Both its feet are echoes of that corner. Without it the wall would end with them, 10 cm beyond the corner.
    The room's cylinder, which may be missed, is another matter.
    """
    room, true, surveyed = taped_room(np.random.default_rng(50110))
    told = posed_label_fit(room, surveyed, true).room
    verdict = judge_fixed(aligned(mapped(surveyed), room, true), room, surveyed, told)
    assert "wall 5" in verdict.due
    assert set(verdict.missed) <= {"cylinder 0"}
    assert verdict.false == ()


def test_walls_are_reported_whose_directions_only_the_poses_leave_open() -> None:
    """A room in which two units hear the same two walls and know hardly how they are turned themselves."""
    room, true, surveyed = taped_room(np.random.default_rng(50072))
    contour = mapped(surveyed)
    told = posed_label_fit(room, surveyed, true).room
    verdict = judge_fixed(aligned(contour, room, true), room, surveyed, told)
    assert len(verdict.due) > 1
    assert (verdict.missed, verdict.false) == ((), ())
    limit_rad = LimitConfig().most_theta_sigma_rad
    assert max(np.sqrt(wall.covariance[0, 0]) for wall in contour.walls) > limit_rad


@cache
def rooms() -> list[Taped]:
    with two_processes() as pool:
        return list(pool.map(judged, range(FIRST_SEED, FIRST_SEED + ROOMS)))


# What is reached, and one standard deviation of so few: of these 40 rooms 3 of 144 walls, 5 of 100 corners and 3 of 23
# cylinders are missed and nothing is false; in 120 rooms not developed on 5 objects were, so 1.7 in 40, give or take
# 1.3. Wanted are 3 % of walls, 5 % of corners and of cylinders, and 2 false objects in 50 rooms.
MOST_MISSED = {"wall": 0.035, "corner": 0.075, "cylinder": 0.2}
MOST_FALSE = 3


@pytest.mark.soak
@pytest.mark.parametrize("kind", MOST_MISSED)
def test_nearly_all_is_found_by_tape_measure(kind: str) -> None:
    due, missed = (
        sum(what.startswith(kind) for one in rooms() for what in getattr(one.verdict, of)) for of in ("due", "missed")
    )
    assert due > ROOMS // 4
    assert missed <= MOST_MISSED[kind] * due, f"{missed} of {due}"


@pytest.mark.soak
def test_hardly_anything_is_invented_by_tape_measure() -> None:
    false = {one.seed: one.verdict.false for one in rooms() if one.verdict.false}
    assert sum(map(len, false.values())) <= MOST_FALSE, false


@pytest.mark.soak
def test_corners_by_tape_measure_err_by_little_more_than_where_every_label_is_known() -> None:
    """Beside the fit that knows what made each echo and, as the mapper, the poses by tape measure alone."""
    ours, told = (np.concatenate([getattr(one.verdict, of) for one in rooms()]) for of in ("corners_m", "label_fit_m"))
    assert ours.mean() < 1.5 * told.mean()


@pytest.mark.soak
def test_no_pose_of_a_tape_measure_is_called_wrong() -> None:
    assert [(one.seed, one.named) for one in rooms() if one.named] == []


@pytest.mark.soak
def test_errors_of_most_poses_are_as_large_as_stated() -> None:
    """The middle of the squares is chi-square's to within a quarter; rooms that were misunderstood are in the tail."""
    squares = np.concatenate([one.squares for one in rooms()])
    assert 0.75 < np.median(squares) / chi2.median(3) < 1.25


def _wrong(seed: int, kind: str) -> tuple[bool, set[str], set[str]]:
    """Whether the room can tell, which units are stated wrong, and which are named."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 6))
    room, _, surveyed = taped_room(rng, count)
    stated = np.array([(one.sweep.x_m, one.sweep.y_m, one.sweep.heading_rad) for one in surveyed[:count]])
    first, second = rng.choice(count, 2, replace=False)
    if kind == "exchanged":
        stated[[first, second]] = stated[[second, first]]
    elif kind == "shifted":
        away_rad = rng.uniform(0, 2 * np.pi)
        stated[first, :2] += 0.3 * np.array([np.cos(away_rad), np.sin(away_rad)])
    else:
        stated[first, 2] += np.radians(20) * rng.choice([-1, 1])
    wrong = {f"u{first + 1}"} | ({f"u{second + 1}"} if kind == "exchanged" else set())
    can_tell = room_can_tell(room, surveyed, wrong)
    if not can_tell:
        return False, wrong, set()
    return True, wrong, {pose.unit for pose in mapped(stated_by_tape(surveyed, stated)).poses if pose.is_wrong}


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["shifted", "turned", "exchanged"])
def test_wrong_poses_are_named_where_the_room_can_tell(kind: str) -> None:
    with two_processes() as pool:
        tried = list(pool.map(_wrong, range(FIRST_SEED, FIRST_SEED + WRONG_ROOMS), [kind] * WRONG_ROOMS))
    told = [(wrong, named) for can_tell, wrong, named in tried if can_tell]
    assert len(told) > WRONG_ROOMS / 12
    # What is reached, not yet what is wanted: nearly all.
    assert sum(wrong <= named for wrong, named in told) >= 0.6 * len(told), told
