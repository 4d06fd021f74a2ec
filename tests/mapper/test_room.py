"""The specular room that the mapper is judged in: it must be as HC-SR04s are, and tell the mapper nothing else."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.json_format import MessageToDict, Parse
from mapper.room import (
    BEARINGS_RAD,
    HARD,
    PLAIN,
    Label,
    Physics,
    Room,
    distance_to_sides_m,
    message_of,
    paper_path,
    paper_room,
    random_room,
    survey_labelled,
    walk,
)

import noctule_mapper
from noctule.messages_pb2 import Sweep
from noctule_mapper.config import SensorConfig
from noctule_mapper.readings.sweep import from_message

EXACT = Physics(sigma_m=1e-12)
SQUARE = Room(np.array([(0.0, 0), (3, 0), (3, 3), (0, 3)]))
AHEAD = 6  # the index of bearing 0


def heard(room: Room, pose: tuple[float, float, float], physics: Physics = EXACT, seed: int = 1):
    """Ranges (13,) and labels of one sweep."""
    (one,) = survey_labelled(room, np.array([pose]), np.random.default_rng(seed), physics)
    return one.sweep.range_m, one.labels


def wedge(interior_deg: float) -> Room:
    """A triangle or a kite with a corner of ``interior_deg`` at the origin, opening along x."""
    half = math.radians(interior_deg / 2)
    c, s = 3 * math.cos(half), 3 * math.sin(half)
    return Room(np.array([(0, 0), (c, -s), (max(c + 1, 2), 0), (c, s)]))


def test_a_wall_answers_from_the_foot_of_its_perpendicular_and_a_right_corner_from_its_point():
    # Heading along x from (1, 1): the walls to the right, ahead and to the left are 1, 2 and 2 m away.
    range_m, labels = heard(SQUARE, (1.0, 1.0, 0.0))
    expected = {
        -90: (1.0, Label("wall", 0)),
        0: (2.0, Label("wall", 1)),
        90: (2.0, Label("wall", 2)),
        -135: (math.sqrt(2), Label("corner", 0)),
    }
    for bearing_deg, (true_m, label) in expected.items():
        at = int(np.argmin(np.abs(BEARINGS_RAD - math.radians(bearing_deg))))
        assert range_m[at] == pytest.approx(true_m)
        assert labels[at] == label
    assert np.isnan(range_m[AHEAD + 1]) and labels[AHEAD + 1] == Label("none")


def test_an_acute_corner_answers_nearer_than_it_is():
    # Double bounce: d sin(a). From 0.8 m before a corner of 60 degrees, on its bisector; the feet are 30 degrees off.
    range_m, labels = heard(wedge(60), (0.8, 0.0, math.pi))
    assert range_m[AHEAD] == pytest.approx(0.8 * math.sin(math.radians(60)))
    assert labels[AHEAD] == Label("corner", 0)


def test_a_corner_answers_ever_more_rarely_as_it_opens():
    heard_shares = []
    for interior_deg in (85, 100, 115, 140):
        told = [heard(wedge(interior_deg), (0.8, 0.0, math.pi), seed=seed)[1][AHEAD].kind for seed in range(200)]
        heard_shares.append(told.count("corner") / 200)
    assert heard_shares[0] == 1 and heard_shares[-1] == 0
    assert heard_shares[0] > heard_shares[1] > heard_shares[2] > heard_shares[3]


def test_a_reflex_edge_answers_only_close_by():
    notched = Room(np.array([(0.0, 0), (3, 0), (3, 1.5), (1.5, 1.5), (1.5, 3), (0, 3)]))
    labels = {away_m: heard(notched, (1.5 - away_m, 1.5 - away_m, math.pi / 4))[1][AHEAD].kind for away_m in (0.2, 0.7)}
    assert labels == {0.2: "edge", 0.7: "none"}


def test_a_cylinder_of_9_cm_is_heard_to_about_2_m_and_a_thicker_one_farther():
    hall = Room(np.array([(-9.0, -9), (9, -9), (9, 9), (-9, 9)]))
    for radius, away_m, kind in ((0.09, 1.9, "cylinder"), (0.09, 2.1, "none"), (0.3, 2.1, "cylinder")):
        room = replace(hall, cylinders=((0.0, 0.0, radius),))
        range_m, labels = heard(room, (-away_m, 0.0, 0.0), replace(PLAIN, sigma_m=1e-12, late_share=0))
        assert labels[AHEAD].kind == kind
        assert kind == "none" or range_m[AHEAD] == pytest.approx(away_m - radius)


def test_what_stands_before_a_wall_hides_it():
    room = replace(SQUARE, cylinders=((2.0, 1.0, 0.2),))
    range_m, labels = heard(room, (1.0, 1.0, 0.0))
    assert range_m[AHEAD] == pytest.approx(0.8)
    assert Label("wall", 1) not in labels


def test_the_lobe_is_20_degrees_close_by_9_to_10_in_the_middle_and_narrower_beyond():
    widths_deg = PLAIN.half_width_deg(np.linspace(0.02, 4.0, 400))
    assert np.all(np.diff(widths_deg) <= 1e-9)
    assert PLAIN.half_width_deg(0.25) == pytest.approx(20)
    assert np.all(PLAIN.half_width_deg(np.linspace(0.5, 1.5, 20)) <= 10 + 1e-9)
    assert PLAIN.half_width_deg(1.5) == pytest.approx(9)
    assert PLAIN.half_width_deg(4.0) < 8


def test_close_by_an_echo_comes_from_outside_the_stated_beam():
    # The wall 0.25 m to the right lies 15 degrees off the beam's axis, the stated half-width is 11.25.
    pose = (1.5, 0.25, math.radians(15))
    at = int(np.argmin(np.abs(BEARINGS_RAD - math.radians(-90))))
    assert heard(SQUARE, pose)[1][at].kind == "none"
    assert heard(SQUARE, pose, replace(PLAIN, late_share=0))[1][at] == Label("wall", 0)


def test_echoes_are_late_false_and_lost_as_often_as_the_physics_says():
    # 4 % false, 8 % lost, 5 % of the rest a cycle of 4.3 mm late; four binomial standard deviations either way. In a
    # square every corner answers, so that the number of echoes is no matter of chance.
    poses = np.tile(walk(np.array([(0.5, 0.5), (2.5, 0.5), (2.5, 2.5), (0.5, 2.5)]), 0.2), (10, 1))
    quiet = survey_labelled(SQUARE, poses, np.random.default_rng(1), replace(HARD, false_share=0, lost_share=0))
    labelled = survey_labelled(SQUARE, poses, np.random.default_rng(1), HARD)
    echoes, kept = (sum(int(np.isfinite(one.sweep.range_m).sum()) for one in some) for some in (quiet, labelled))
    false = sum(label.kind == "false" for one in labelled for label in one.labels)
    late = sum(int((one.late_m == 0.0043).sum()) for one in labelled)
    for count, share in ((echoes - kept, 0.08), (false, 0.92 * 0.04), (late, 0.92 * 0.96 * 0.05)):
        assert abs(count - share * echoes) < 4 * math.sqrt(share * echoes)


def test_a_pose_error_moves_all_ranges_of_a_place_and_is_stated_as_a_spread_alone():
    sloppy = replace(EXACT, sigma_position_m=0.004)
    poses = np.array([(1.0, 1.0, 0.0)] * 2 + [(1.0, y, 0.0) for y in np.linspace(0.9, 1.1, 300)])
    labelled = survey_labelled(SQUARE, poses, np.random.default_rng(2), sloppy)
    errors_m = np.array([one.sweep.range_m[AHEAD] - 2.0 for one in labelled])
    assert errors_m[0] == pytest.approx(errors_m[1], abs=1e-9)
    assert np.std(errors_m[2:]) == pytest.approx(0.004, rel=0.15)  # 300 places: 4 %
    assert {(one.sweep.x_m, one.sweep.sigma_position_m) for one in labelled} == {(1.0, 0.004)}


def test_every_label_names_the_reflector_that_explains_the_range():
    rng = np.random.default_rng(3)
    for _ in range(5):
        room, poses = random_room(rng)
        for pose, one in zip(poses, survey_labelled(room, poses, rng, replace(PLAIN, sigma_m=1e-9)), strict=True):
            for range_m, late_m, label in zip(one.sweep.range_m, one.late_m, one.labels, strict=True):
                if label.kind == "none":
                    assert np.isnan(range_m)
                else:
                    assert range_m - late_m == pytest.approx(_expected_m(room, pose[:2], label), abs=1e-7)


def _expected_m(room: Room, place: np.ndarray, label: Label) -> float:
    if label.kind == "wall":
        return distance_to_sides_m(place, room.vertices)[label.index]
    if label.kind == "cylinder":
        x, y, radius = room.cylinders[label.index]
        return math.hypot(x - place[0], y - place[1]) - radius
    interior_rad = room.interior_rad[label.index]
    factor = math.sin(interior_rad) if interior_rad < math.pi / 2 else 1.0
    return factor * math.hypot(*(room.vertices[label.index] - place))


@pytest.mark.parametrize("celsius", [5.0, 20.0, 35.0])
def test_a_survey_comes_through_messages_and_json_as_it_was(celsius):
    for one in survey_labelled(paper_room(), paper_path()[:5], np.random.default_rng(4)):
        line = json.dumps(MessageToDict(message_of(one.sweep, celsius)))
        read = from_message(Parse(line, Sweep()), SensorConfig(range_bias_m=0.5))
        assert read.range_m == pytest.approx(one.sweep.range_m, nan_ok=True)
        assert read.range_sigma_m == one.sweep.range_sigma_m
        assert (read.x_m, read.y_m, read.heading_rad) == (one.sweep.x_m, one.sweep.y_m, one.sweep.heading_rad)


def test_a_survey_by_a_sensor_that_is_not_calibrated_tells_no_spread():
    (one,) = survey_labelled(paper_room(), paper_path()[:1], np.random.default_rng(5), calibrated=False)
    assert not message_of(one.sweep, 20.0).sensor.HasField("range_sigma_m")
    assert one.sigma_m == 0.0032  # Section V.A


def test_random_rooms_are_what_they_promise():
    walls, cylinders, reflex = set(), set(), 0
    for seed in range(150):
        room, poses = random_room(np.random.default_rng(seed))
        walls.add(len(room.vertices))
        cylinders.add(len(room.cylinders))
        interior_deg = np.degrees(room.interior_rad)
        reflex += bool(np.any(interior_deg > 180))
        assert np.all((interior_deg > 50) & ((interior_deg < 170) | np.isclose(interior_deg, 270)))
        inset_m = [distance_to_sides_m(pose[:2], room.vertices).min() for pose in poses]
        farthest_m = 0.7 * math.sqrt(2) if np.any(interior_deg > 180) else 0.7  # the path turns about a reflex edge
        assert min(inset_m) > 0.3 - 1e-9
        assert max(inset_m) < farthest_m + 1e-9
        for x, y, radius in room.cylinders:
            assert 0.05 <= radius <= 0.45
            assert distance_to_sides_m(np.array([x, y]), room.vertices).min() > radius + 0.15
            assert np.hypot(*(poses[:, :2] - (x, y)).T).min() > radius + 0.15
    assert (walls, cylinders) == ({4, 5, 6, 7}, {0, 1, 2})
    assert 30 < reflex < 90  # two in five are Ls


def test_the_mapper_knows_nothing_of_the_simulated_room():
    package = Path(noctule_mapper.__file__).parent
    told = [path for path in package.rglob("*.py") if "noctule_reproduction" in path.read_text()]
    assert told == []
