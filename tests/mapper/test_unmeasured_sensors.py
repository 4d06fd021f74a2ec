"""Sensors that nobody has measured: a mean error, the air's temperature, a face that stands off the axis."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from mapper.fixed_units import FIXED, fixed_room, judge_fixed, survey_by_unmeasured, unmeasured
from mapper.judge import corner_errors_m, corner_squares, wall_squares
from mapper.room import LabelledSweep, Room
from scipy.stats import chi2
from system.processes import two_processes

from noctule_mapper.config import SensorConfig
from noctule_mapper.contour.contour import Contour
from noctule_mapper.mapper import Mapper

# No room from these seeds on was ever looked at while the mapper was made.
FIRST_SEED, ROOMS = 96_000, 40
ROOM = Room(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]))
UNITS = np.array([(0.5, 0.6, 0.5), (3.4, 0.8, 2.6), (3.5, 2.4, -2.2), (0.6, 2.5, -0.9), (2.1, 0.5, 1.5)])
FACE_M = 0.02


def mapped(surveyed: list[LabelledSweep]) -> Contour:
    mapper = Mapper()
    for one in surveyed:
        mapper.register_sweep(one.sweep)
    return mapper.contour()


def surveyed(faces_m: list[float], states: SensorConfig | None = None) -> list[LabelledSweep]:
    """By units whose sensors stand ``faces_m`` off their axes."""
    sensors = [replace(FIXED, face_offset_m=face_m) for face_m in faces_m]
    return survey_by_unmeasured(ROOM, UNITS, np.random.default_rng(2), sensors, states)


def test_a_room_is_known_by_units_whose_faces_stand_off_their_axes_as_nobody_has_stated() -> None:
    contour = mapped(surveyed([FACE_M, -0.01, 0.03, 0.0, 0.035]))
    assert len(contour.walls) == len(contour.corners) == 4
    # On average they stand 1.5 cm off; the room's corners tell, as they lie root 2 times as far away as its walls.
    assert corner_errors_m(contour, ROOM).max() < 0.015
    for corner in contour.corners:
        error = ROOM.vertices - (corner.x_m, corner.y_m)
        square = (error * np.linalg.solve(corner.covariance, error.T).T).sum(axis=1).min()
        assert square < 13.8  # chi-square with 2 degrees of freedom: by chance in one of a thousand


def test_stated_faces_are_as_good_as_faces_on_the_axis() -> None:
    stated = mapped(surveyed([FACE_M] * 5, SensorConfig(**MEASURED, face_offset_m=FACE_M)))
    assert len(stated.corners) == 4
    assert corner_errors_m(stated, ROOM).max() < 0.003
    ignored = mapped(surveyed([FACE_M] * 5, SensorConfig(**MEASURED)))
    assert corner_errors_m(ignored, ROOM).max() > 0.02


MEASURED = {"range_bias_m": 0.0, "air_temperature_c": 20.0}
FACES_M = [0.02, -0.01, 0.03, 0.0, 0.035]


def stating(faces_m: list[float], sigma_m: float) -> list[LabelledSweep]:
    """By units whose faces are FACES_M off, each stated to be ``faces_m`` off, as the site file has it unit by unit."""
    stated = []
    for one in surveyed(FACES_M, SensorConfig(**MEASURED)):
        face_m = faces_m[int(one.sweep.unit[1:]) - 1]
        sweep = replace(
            one.sweep, range_m=one.sweep.range_m + face_m, face_offset_m=face_m, face_offset_sigma_m=sigma_m
        )
        stated.append(replace(one, sweep=sweep))
    return stated


def test_each_unit_has_the_face_that_is_stated_of_it() -> None:
    assert corner_errors_m(mapped(stating(FACES_M, 0.0)), ROOM).max() < 0.003


def test_the_fit_finds_how_far_each_face_is_from_where_it_is_stated_to_be() -> None:
    off_m = [0.02, -0.02, 0.02, -0.02, 0.02]
    wrong_m = [face_m + off for face_m, off in zip(FACES_M, off_m, strict=True)]
    held, fitted = (corner_errors_m(mapped(stating(wrong_m, sigma_m)), ROOM) for sigma_m in (0.0, 0.02))
    assert held.max() > 0.01
    assert fitted.max() < 0.006


def unmeasured_room(seed: int) -> tuple[Room, list[LabelledSweep]]:
    """A random room by units that nobody has measured, in one air that nobody has measured."""
    rng = np.random.default_rng(seed)
    room, poses = fixed_room(rng)
    celsius = rng.normal(SensorConfig().air_temperature_c, SensorConfig().assumed_temperature_sigma_k)
    return room, survey_by_unmeasured(room, poses, rng, [unmeasured(rng, celsius) for _ in poses])


def test_ranges_a_few_centimetres_too_long_cost_no_wall_once_they_are_found_out() -> None:
    """Fits of a few objects drew the sensors back to what was stated, and the map fell apart in its second round."""
    for seed in (5014, 5016):
        room, surveyed = unmeasured_room(seed)
        assert not judge_fixed(mapped(surveyed), room, surveyed).missed


def test_what_one_unit_alone_heard_is_known_no_better_than_its_sensor() -> None:
    """3 mm, 0.9 % of 0.5 to 3 m and 2 cm of the face: no echo tells the one unit how far all that it hears is off."""
    sensors = [replace(FIXED, face_offset_m=FACE_M)]
    contour = mapped(survey_by_unmeasured(ROOM, UNITS[:1], np.random.default_rng(2), sensors))
    assert contour.walls or contour.touches
    for wall in contour.walls:
        to_line = np.array([-UNITS[0, :2] @ (-wall.normal[1], wall.normal[0]), 1.0])
        assert np.sqrt(to_line @ wall.covariance @ to_line) > 0.019
    for touch in contour.touches:
        towards = np.array([np.cos(touch.direction_rad), np.sin(touch.direction_rad)])
        assert np.sqrt(towards @ touch.covariance @ towards) > 0.019


@dataclass(frozen=True)
class _Judged:
    due: int
    missed: int
    false: int
    squares: dict[str, tuple[float, ...]]


@cache
def rooms() -> list[_Judged]:
    with two_processes() as pool:
        return list(pool.map(_room, range(FIRST_SEED, FIRST_SEED + ROOMS)))


def _room(seed: int) -> _Judged:
    room, surveyed = unmeasured_room(seed)
    contour = mapped(surveyed)
    verdict = judge_fixed(contour, room, surveyed)
    squares = {
        "wall": wall_squares(contour, room),
        "corner": corner_squares(contour, room),
    }
    return _Judged(len(verdict.due), len(verdict.missed), len(verdict.false), squares)


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["wall", "corner"])
def test_what_unmeasured_sensors_hear_errs_as_stated(kind: str) -> None:
    """Chi-square at 1 %. One of each room that was understood: others of it share its sensors' errors and its air.

    In three rooms out of fifty the sensors are fitted wrongly: there squares are large, as chance makes hardly one in a
    thousand.
    """
    rng = np.random.default_rng(1)
    of_room = [one.squares[kind] for one in rooms() if not one.missed and not one.false and one.squares[kind]]
    chosen = np.array([rng.choice(squares) for squares in of_room])
    assert len(chosen) >= ROOMS // 2
    wrong = chosen > chi2.ppf(0.999, 2)
    assert wrong.sum() <= ROOMS // 20
    fitted = chosen[~wrong]
    least, most = chi2.ppf([0.005, 0.995], 2 * len(fitted))
    assert least < fitted.sum() < most


@pytest.mark.soak
def test_unmeasured_sensors_cost_few_objects() -> None:
    """What is reached; by the same units with measured sensors 7 of 98 are missed."""
    due, missed, false = (sum(getattr(one, of) for one in rooms()) for of in ("due", "missed", "false"))
    assert due > 4 * ROOMS
    assert missed <= 0.1 * due, f"{missed} of {due}"
    assert false <= ROOMS // 2
