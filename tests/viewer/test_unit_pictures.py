"""A unit's tab: its last sweep from its own place, and what it has heard at each bearing."""

import io
from collections.abc import Iterable
from math import radians
from typing import Any

import numpy as np
import pytest
from PIL import Image

from noctule import rerun_paths
from noctule.air import speed_of_sound_m_s
from noctule.messages_pb2 import READING_STATUS_ECHO, READING_STATUS_NO_ECHO, READING_STATUS_STUCK_HIGH, Sweep
from noctule.unit_colours import unit_colour
from noctule_viewer import blueprint
from noctule_viewer.board import bearings, echo_history, polar
from noctule_viewer.board.heard_sweeps import MOST_SWEEPS, HeardSweep, HeardSweeps, heard_sweep
from noctule_viewer.board.turns import DRAWN_AGAIN_AFTER_S, Turns

BEAM_RAD = radians(20)


def sweep(second: float = 0.0, ranges_m: Iterable[float | None] = (1.0, None), step_deg: float = 30) -> Sweep:
    """An echo for each range and silence for each None, from 90 degrees to the left on, clockwise."""
    made = Sweep(unit="u1", air_temperature_c=20.0)
    made.start.FromNanoseconds(round(second * 1e9))
    made.sensor.beam_width_rad, made.sensor.range_bias_m = BEAM_RAD, 0.002
    for number, range_m in enumerate(ranges_m):
        reading = made.readings.add(bearing_rad=radians(90 - step_deg * number), status=READING_STATUS_NO_ECHO)
        if range_m is not None:
            reading.status = READING_STATUS_ECHO
            reading.time_of_flight_s = 2 * (range_m + 0.002) / speed_of_sound_m_s(20.0)
    return made


def heard_sweeps(*sweeps: Sweep) -> list[HeardSweep]:
    return [heard_sweep(each) for each in sweeps]


def components(entries: Iterable[tuple[str, Any]], path: str) -> dict[str, list]:
    """The components of an entity as they are logged."""
    logged = [what for at, what in entries if at == path]
    batches = [batch for what in logged for batch in what.as_component_batches()]
    return {batch.component_descriptor().component: batch.as_arrow_array().to_pylist() for batch in batches}


def test_ranges_are_free_of_the_sensors_bias_and_of_the_airs_temperature() -> None:
    made = sweep(ranges_m=[1.5, None, None])
    made.readings[2].status = READING_STATUS_STUCK_HIGH
    seen = heard_sweep(made)
    assert seen.range_m == pytest.approx([1.5, np.nan, np.nan], nan_ok=True)
    assert seen.silent.tolist() == [False, True, False]
    assert seen.faulty.tolist() == [False, False, True]


def test_an_echo_is_an_arc_as_wide_as_the_beam_and_left_is_left() -> None:
    entries = list(polar.draw_polar("u1", heard_sweep(sweep(ranges_m=[1.0, None])), outermost_m=2.0))
    drawn = components(entries, rerun_paths.unit_polar("u1"))
    (arc,) = drawn["LineStrips2D:strips"]
    assert np.hypot(*np.transpose(arc)) == pytest.approx(0.5)  # half of the outermost circle
    assert np.mean(arc, axis=0)[0] < -0.49  # to the left
    turned_rad = [np.arctan2(-x, -y) for x, y in (arc[0], arc[-1])]
    assert turned_rad == pytest.approx([radians(80), radians(100)])
    assert drawn["Points2D:labels"] == ["", "nearest 1.00 m, left 90°"]
    assert drawn["Points2D:positions"][0] == pytest.approx([-np.sin(radians(60)), -np.cos(radians(60))])  # silent


@pytest.mark.parametrize(("farthest_m", "outermost_m"), [(0.42, 0.5), (1.1, 1.25), (3.3, 4.0), (7.0, 8.0)])
def test_circles_are_at_whole_steps_and_bear_their_ranges(farthest_m: float, outermost_m: float) -> None:
    found_m = polar.outermost_m(heard_sweeps(sweep(ranges_m=[0.3, farthest_m])))
    assert found_m == pytest.approx(outermost_m)
    labels = components(polar.draw_rings("u1", found_m, BEAM_RAD), rerun_paths.unit_rings("u1"))["Points2D:labels"]
    assert f"{outermost_m:g} m" in labels
    assert {"ahead", "behind", "left 90°", "right 90°", "beam 20°"} <= set(labels)


def test_a_unit_that_hears_nothing_at_all_has_a_picture() -> None:
    silent = heard_sweeps(sweep(ranges_m=[None, None]))
    assert polar.outermost_m(silent) == 1.0
    assert components(polar.draw_polar("u1", silent[0], 1.0), rerun_paths.unit_polar("u1"))["Points2D:labels"] == [
        "",
        "",
    ]
    assert list(echo_history.draw_echo_history("u1", silent, 1.0, 0.0))


def picture(of: list[HeardSweep], outermost_m: float) -> tuple[np.ndarray, int]:
    """(rows, columns, 3) of the history, and the size of the file that the viewer is sent."""
    drawn = components(echo_history.draw_echo_history("u1", of, outermost_m, 0.0), rerun_paths.unit_echo_history("u1"))
    (png,) = drawn["EncodedImage:blob"]
    return np.array(Image.open(io.BytesIO(bytes(png))).convert("RGB")), len(png)


def test_the_history_has_the_newest_sweep_on_top_and_a_column_for_each_bearing() -> None:
    pixels, _ = picture(heard_sweeps(sweep(1.0, [1.0, 1.0, None]), sweep(2.0, [None, 1.0, 2.0])), outermost_m=2.0)
    left, middle, right = 20, 280, 460  # of 480 between 90 and 0 degrees: bearings of 90, 60 and 30 degrees
    grey, ground = list(polar.SILENT), list(blueprint.CALM)
    assert np.abs(pixels[0, left].astype(int) - grey).max() <= 8  # the palette rounds
    assert np.abs(pixels[1, 310].astype(int) - grey).max() <= 8
    assert np.abs(pixels[0, middle - 120].astype(int) - pixels[1, left]).max() <= 8  # both one metre away
    assert np.abs(pixels[0, 320].astype(int) - pixels[0, middle - 120]).max() > 30  # two metres
    assert np.abs(pixels[0, right].astype(int) - ground).max() <= 8  # where it has not looked
    assert np.abs(pixels[2, left].astype(int) - ground).max() <= 8  # before its first sweep


def test_the_history_of_a_unit_is_bounded_and_small() -> None:
    noise = np.random.default_rng(1)
    kept = HeardSweeps()
    for second in range(1_000):
        kept.note(sweep(second, noise.uniform(0.2, 4.0, 64), step_deg=4), now_s=second)
    of_unit = kept.all()["u1"]
    assert len(of_unit) == MOST_SWEEPS
    assert of_unit[-1].time_s == 999.0
    assert picture(list(of_unit), 4.0)[1] < 20_000, "the worst case: each echo anywhere"
    kept.note(sweep(5.0), now_s=1_000.0)
    assert kept.all()["u1"][-1].time_s == 999.0, "an old sweep, sent again"


def test_units_that_strangers_name_take_no_memory_without_end() -> None:
    kept = HeardSweeps()
    for number in range(1_000):
        named = sweep()
        named.unit = f"u{number}"
        kept.note(named, now_s=0.0)
        kept.note(sweep(number), now_s=number)
    assert len(kept.all()) == 60
    assert len(kept.all()["u1"]) > 1, "a unit that goes on stays"


def test_a_sweep_that_is_dated_in_the_future_does_not_stop_the_pictures() -> None:
    kept = HeardSweeps()
    for at_s, now_s in ((1.0, 1.0), (9_000.0, 2.0), (3.0, 3.0), (4.0, 4.0)):
        kept.note(sweep(at_s), now_s)
    assert [each.time_s for each in kept.all()["u1"]] == [1.0, 3.0, 4.0]
    behind = HeardSweeps()  # by the viewer's own clock, all of it is in the future
    for at_s in (9_000.0, 9_001.0, 9_002.0):
        behind.note(sweep(at_s), now_s=0.0)
    assert len(behind.all()["u1"]) == 3


def test_units_are_drawn_one_after_the_other_and_again_before_the_relay_forgets_them() -> None:
    now_s = [100.0]
    turns = Turns(2.0, lambda: now_s[0])
    states = {"u1": 1.0, "u2": 1.0}
    assert [turns.take(states), turns.take(states)] == ["u1", None]
    now_s[0] += 2.0
    assert turns.take(states) == "u2"
    now_s[0] += 2.0
    assert turns.take(states) is None, "nothing is new"
    assert turns.take({"u1": 1.0, "u2": 2.0}) == "u2"
    now_s[0] += DRAWN_AGAIN_AFTER_S
    assert turns.take(states) == "u1"


@pytest.mark.parametrize(
    ("degrees", "words"), [(0, "ahead"), (90, "left 90°"), (-45, "right 45°"), (180, "behind"), (-180, "behind")]
)
def test_bearings_are_words(degrees: float, words: str) -> None:
    assert bearings.words(radians(degrees)) == words


def test_a_unit_has_one_colour_in_all_pictures() -> None:
    assert len({unit_colour(f"u{number}") for number in range(1, 6)}) == 5
