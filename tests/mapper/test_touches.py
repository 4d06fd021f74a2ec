"""One place: what a unit alone can tell, and what it publishes where it cannot."""

import json
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mapper.fixed_units import due_alone, fixed_room, found_alone, rectangular_room, survey_fixed
from mapper.judge import false_objects
from mapper.room import Room
from system.processes import two_processes

from noctule import bounds
from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.contour import Contour, Touch
from noctule_mapper.contour.table import contour_table
from noctule_mapper.mapper import Mapper
from noctule_mapper.messages import contour_message
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.refinement.touches import kind_chances

CONFIG = RefinementConfig()
FIRST_SEED, RECTANGLES, ANY_ROOMS = 93_000, 100, 200  # no room from these seeds on was looked at while this was made
RECTANGLE = Room(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]))
IN_THE_MIDDLE = np.array([(1.6, 1.1, np.pi / 2)])


def contour_of(room: Room, poses: np.ndarray, rng: np.random.Generator) -> Contour:
    mapper = Mapper()
    for one in survey_fixed(room, poses, rng):
        mapper.register_sweep(one.sweep)
    return mapper.contour()


@pytest.mark.parametrize("seed", range(3))
def test_one_unit_in_a_rectangle_knows_the_walls_of_its_sweep(seed: int) -> None:
    contour = contour_of(RECTANGLE, IN_THE_MIDDLE, np.random.default_rng(seed))
    # From (1.6, 1.1), looking north: east at 2.4 m, north at 1.9 m, west at 1.6 m; south lies behind it.
    due = due_alone(RECTANGLE, IN_THE_MIDDLE[0])
    assert {number: distance_m for number, (_, distance_m) in due.items()} == pytest.approx({1: 2.4, 2: 1.9, 3: 1.6})
    assert found_alone(contour, RECTANGLE, IN_THE_MIDDLE[0]) == [1, 2, 3]
    assert not false_objects(contour, RECTANGLE)
    assert all(0.99 < wall.chance < 1 for wall in contour.walls)


def test_what_two_places_determine_has_the_chance_one() -> None:
    poses = np.array([(0.3, 0.6, 0.5), (3.7, 0.8, 2.6), (3.5, 2.6, -2.2), (0.6, 2.7, -0.9)])
    contour = contour_of(RECTANGLE, poses, np.random.default_rng(1))
    assert [wall.chance for wall in contour.walls] == [1.0] * 4


def test_one_wall_alone_is_a_touch_at_its_foot() -> None:
    # A triangle of 60 degrees: no right angle anywhere. The foot of the wall y = 0 below (1.5, 0.6).
    room = Room(np.array([(0.0, 0.0), (3.0, 0.0), (1.5, 2.598)]))
    contour = contour_of(room, np.array([(1.5, 0.6, -np.pi / 2)]), np.random.default_rng(1))
    assert not contour.walls
    foot = min(contour.touches, key=lambda one: np.hypot(one.x_m - 1.5, one.y_m))
    assert foot.y_m == pytest.approx(0, abs=0.01)
    assert foot.x_m == pytest.approx(1.5, abs=0.6 * np.radians(4))
    along, across = np.sqrt(foot.covariance[1, 1]), np.sqrt(foot.covariance[0, 0])
    assert along < 0.003  # the median of many ranges of 3.2 mm
    assert across == pytest.approx(0.6 * np.radians(1.3), rel=0.5)
    assert foot.unit == "u1"
    assert foot.readings > 8
    # Half-width 10 degrees at 0.6 m, and steps of 4.5 degrees.
    assert np.degrees(foot.width_rad) == pytest.approx(20, abs=7)
    assert foot.chance_wall > max(foot.chance_corner, foot.chance_cylinder)


@pytest.mark.filterwarnings("error")
@settings(max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), turn=st.floats(0.05, 3.0), alone=st.booleans())
def test_touches_turn_with_their_frame_and_their_chances_sum_to_one(seed: int, turn: float, alone: bool) -> None:
    rng = np.random.default_rng(seed)
    room, poses = fixed_room(rng, 1 if alone else 2)
    c, s = np.cos(turn), np.sin(turn)
    turned = np.array([[c, -s], [s, c]])
    other = Room(room.vertices @ turned.T, tuple((*(turned @ (x, y)), r) for x, y, r in room.cylinders))
    there = np.column_stack([poses[:, :2] @ turned.T, poses[:, 2] + turn])
    first, second = (contour_of(one, at, np.random.default_rng(seed)) for one, at in ((room, poses), (other, there)))
    for touch in first.touches + second.touches:
        assert touch.chance_wall + touch.chance_corner + touch.chance_cylinder == pytest.approx(1)
        assert min(touch.chance_wall, touch.chance_corner, touch.chance_cylinder) >= 0
        assert np.linalg.eigvalsh(touch.covariance).min() > 0
    for touch in first.touches:
        twin = _nearest(second.touches, turned @ (touch.x_m, touch.y_m))
        # Where a bearing is rounded the other way, a plateau may be cut otherwise.
        if twin is not None and abs(wrapped(np.array(twin.direction_rad - touch.direction_rad - turn))) < 1e-6:
            sizes = [np.sqrt(np.linalg.eigvalsh(one.covariance)) for one in (touch, twin)]
            if sizes[0] == pytest.approx(sizes[1], rel=1e-3):
                assert twin.covariance == pytest.approx(turned @ touch.covariance @ turned.T, rel=1e-2, abs=1e-6)
    bounds.check(contour_message(first, "s"))


def _nearest(touches: tuple[Touch, ...], point: np.ndarray) -> Touch | None:
    return min(touches, key=lambda one: np.hypot(one.x_m - point[0], one.y_m - point[1]), default=None)


@pytest.mark.parametrize("range_m", [0.05, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0])
def test_a_kind_is_more_or_less_likely_by_its_range(range_m: float) -> None:
    chances = kind_chances(range_m, CONFIG)
    assert chances.sum() == pytest.approx(1)
    assert chances.min() > 0
    farther = kind_chances(range_m + 0.5, CONFIG)
    assert farther[1] > chances[1]  # corners lie farther away than walls


def test_a_post_is_unlikely_where_posts_fall_silent() -> None:
    assert kind_chances(2.5, CONFIG)[2] < kind_chances(1.4, CONFIG)[2] / 3


def whole_centimetres(rng: np.random.Generator) -> list[SweepReadings]:
    """The scans of a hobby scanner in a room of four walls: 37 readings by 9.8 degrees, whole centimetres, no
    calibration; half of its bearings hear nothing.
    """
    bearing_rad = -np.pi + np.radians(9.73) * np.arange(37)
    sweeps = []
    for number in range(6):
        range_m = np.full(37, np.nan)
        for direction_rad, distance_m in ((0.0, 2.05), (np.pi / 2, 2.2), (np.pi, 2.25), (-np.pi / 2, 2.2)):
            heard = np.abs(wrapped(bearing_rad - direction_rad)) < np.radians(26)
            range_m[heard] = np.round(distance_m + rng.normal(0, 0.004, heard.sum()), 2)
        sweeps.append(
            SweepReadings(
                identity=("one", number),
                unit="u1",
                time_s=float(number),
                x_m=0.0,
                y_m=0.0,
                heading_rad=0.0,
                sigma_position_m=0.0,
                sigma_heading_rad=0.0,
                bearing_rad=bearing_rad,
                range_m=range_m,
                no_echo=np.isnan(range_m),
                beam_width_rad=np.radians(22.5),
                range_sigma_m=None,
            )
        )
    return sweeps


def test_whole_centimetres_from_one_place_are_touches_not_nothing() -> None:
    mapper = Mapper()
    for sweep in whole_centimetres(np.random.default_rng(1)):
        mapper.register_sweep(sweep)
    contour = mapper.contour()
    assert not contour.corners
    for direction_deg, distance_m in ((0, 2.05), (90, 2.2), (180, 2.25), (-90, 2.2)):
        foot = distance_m * np.array([np.cos(np.radians(direction_deg)), np.sin(np.radians(direction_deg))])
        touch = _nearest(contour.touches, foot)
        assert touch is not None
        off = np.array([touch.x_m, touch.y_m]) - foot
        assert off @ np.linalg.solve(touch.covariance + 1e-4 * np.eye(2), off) < 9  # a centimetre's rounding
    message = contour_message(contour, "s")
    assert len(message.touches) == len(contour.touches)
    assert "touch" in contour_table(message)
    json.dumps([list(one.covariance) for one in message.touches], allow_nan=False)


@cache
def alone() -> list[tuple[int, int, tuple[str, ...]]]:
    """Of rectangular rooms: how many walls were due to one unit, how many found well enough, and what is false."""
    with two_processes() as pool:
        return list(pool.map(_alone, range(FIRST_SEED, FIRST_SEED + RECTANGLES)))


def _alone(seed: int) -> tuple[int, int, tuple[str, ...]]:
    rng = np.random.default_rng(seed)
    room, poses = rectangular_room(rng)
    contour = contour_of(room, poses, rng)
    return len(due_alone(room, poses[0])), len(found_alone(contour, room, poses[0])), false_objects(contour, room)


@pytest.mark.soak
def test_one_unit_finds_nine_of_ten_walls_of_rectangular_rooms() -> None:
    due, found = sum(due for due, _, _ in alone()), sum(found for _, found, _ in alone())
    assert due > 2 * RECTANGLES
    assert found >= 0.9 * due, f"{found} of {due}"


@pytest.mark.soak
def test_one_unit_invents_nothing_in_rectangular_rooms() -> None:
    assert not {FIRST_SEED + number: false for number, (_, _, false) in enumerate(alone()) if false}


def _any_room(seed: int) -> tuple[tuple[str, ...], int, int]:
    rng = np.random.default_rng(seed)
    room, poses = fixed_room(rng, 1)
    contour = contour_of(room, poses, rng)
    return false_objects(contour, room), len(contour.walls), len(contour.touches)


@pytest.mark.soak
def test_one_unit_invents_nothing_in_rooms_of_any_shape() -> None:
    with two_processes() as pool:
        verdicts = list(pool.map(_any_room, range(FIRST_SEED, FIRST_SEED + ANY_ROOMS)))
    assert sum(walls for _, walls, _ in verdicts) > ANY_ROOMS / 2  # two rooms of five are right-angled
    assert sum(touches for _, _, touches in verdicts) > ANY_ROOMS
    assert not {FIRST_SEED + number: false for number, (false, _, _) in enumerate(verdicts) if false}
