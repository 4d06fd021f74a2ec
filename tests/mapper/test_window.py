"""Which sweeps a map rests on: of a file the same as of a log, what is left out counted and named."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mapper.command import noctule_mapper
from mapper.live_site import paper_survey

from noctule import survey
from noctule.elapsed import Instant
from noctule.messages_pb2 import READING_STATUS_NO_ECHO, Pose, Sweep
from noctule_mapper.config import Window
from noctule_mapper.live.config import LiveConfig, load_live
from noctule_mapper.live.store import SweepStore
from noctule_mapper.readings.sweep import speed_of_sound_m_s
from noctule_mapper.survey_fit import fit, map_survey
from noctule_mapper.window import windowed

NOW_NS = 2_000_000_000 * 10**9


def sweep(
    number: int, x_m: float = 0.0, start_s: int = 0, unit: str = "u1", log: str = "", epoch: str = "one"
) -> Sweep:
    made = Sweep(site="s", unit=unit, log_id=log or f"log of {unit}", log_sequence=number, pose=Pose(x_m=x_m))
    made.clock_epoch = epoch
    made.start.seconds = start_s
    return made


def wall_sweep(number: int, x_m: float, stands: bool) -> Sweep:
    """13 bearings by 15 degrees towards a wall 1 m north, if it ``stands``."""
    made = sweep(number, x_m, 1_767_225_600 + 2 * number)
    made.sensor.range_sigma_m, made.air_temperature_c, made.sensor.range_bias_m = 0.003, 20.0, 0.0
    for step in range(13):
        reading = made.readings.add(bearing_rad=math.radians(15.0 * step))
        if stands and abs(step - 6) <= 1:
            reading.time_of_flight_s = 2 / speed_of_sound_m_s(20.0)
        else:
            reading.status = READING_STATUS_NO_ECHO
    return made


def along_the_wall(rounds: str) -> list[Sweep]:
    """A round of eleven places for each letter, with the wall standing (w) or gone (-)."""
    return [
        wall_sweep(11 * turn + place + 1, 0.2 * place, letter == "w")
        for turn, letter in enumerate(rounds)
        for place in range(11)
    ]


def written(sweeps: list[Sweep], path: Path) -> Path:
    with path.open("w") as stream:
        survey.write(sweeps, stream)
    return path


stops = st.builds(
    sweep,
    number=st.integers(0, 6),
    x_m=st.sampled_from([0.0, 0.03, 0.2, 1.0]),
    start_s=st.sampled_from([1_000_000_000, 1_000_000_050, 1_000_001_000, 1_900_000_000]),
    unit=st.sampled_from(["u1", "u2"]),
    log=st.sampled_from(["", "", "another"]),
    epoch=st.sampled_from(["", "one", "two"]),
)
windows = st.builds(
    Window,
    max_age_s=st.sampled_from([100.0, 1e6]),
    max_sweeps=st.sampled_from([3, 100]),
    sweeps_per_place=st.integers(1, 3),
)


@settings(max_examples=80)
@given(made=st.lists(stops, max_size=12, unique_by=lambda one: (one.log_id, one.log_sequence)), window=windows)
def test_a_file_leaves_the_same_sweeps_as_a_log(
    tmp_path_factory: pytest.TempPathFactory, made: list[Sweep], window: Window
) -> None:
    store = SweepStore(
        tmp_path_factory.mktemp("window") / "site.sqlite3", window, lambda: Instant(NOW_NS / 1e9, "boot", 1.0)
    )
    store.commit(made, [])
    held = windowed(made, window, NOW_NS)
    in_the_store = {one.SerializeToString() for one in store.sweeps()}
    store.close()
    assert {made[number].SerializeToString() for number in held.held} == in_the_store
    assert sorted([*held.held, *held.left]) == list(range(len(made)))


def test_what_leaves_the_window_of_a_file_is_told_with_the_reason() -> None:
    made = [
        sweep(1, 5.0, 1_000_000_000),
        sweep(2, 0.0, 1_000_900_000),
        sweep(2, 7.0, 1_000_900_000),
        sweep(3, 0.0, 1_000_900_001),
        sweep(4, 1.0, 1_000_900_002),
        sweep(5, 2.0, 1_000_900_003),
    ]
    held = windowed(made, Window(sweeps_per_place=1, max_sweeps=2), NOW_NS)
    assert held.left == {0: "too old", 1: "superseded", 2: "repeated", 3: "too many"}


def test_sweeps_without_a_time_have_no_age() -> None:
    made = [sweep(1, 0.0), sweep(2, 1.0), sweep(3, 2.0, 1_000_000_000)]
    assert windowed(made, Window(max_age_s=10.0), NOW_NS).held == [0, 1, 2]


def test_the_papers_survey_is_in_the_window_as_a_whole() -> None:
    # 44 places of one sweep each, no two the same: Liu et al. 2019, Section VI.
    held = windowed(paper_survey(), Window(), NOW_NS)
    assert (len(held.held), held.left) == (44, {})


@pytest.mark.parametrize(("rounds", "walls"), [("ww", 1), ("ww--", 0), ("ww-", 0), ("--ww", 1)])
def test_a_wall_that_is_taken_away_is_on_no_map_of_the_file(rounds: str, walls: int) -> None:
    records = [survey.Record("file", n, one) for n, one in enumerate(along_the_wall(rounds), start=1)]
    mapper = map_survey(records).mapper
    assert len(mapper.contour().walls) == walls
    occupied = sum(int(np.count_nonzero(tile.occupied >= 0.25)) for tile in mapper.grid.tiles())
    assert (occupied > 0) == (walls > 0)


def test_export_draws_no_cell_of_a_wall_that_is_gone(tmp_path: Path) -> None:
    for rounds, occupied in (("ww", True), ("ww--", False)):
        source = written(along_the_wall(rounds), tmp_path / "survey.jsonl")
        assert noctule_mapper("export", source, tmp_path / "map.yaml").exit_code == 0
        pixels = (tmp_path / "map.pgm").read_bytes().split(b"255\n", 1)[1]
        assert (b"\x00" in pixels) == occupied  # 0 is black is occupied: map_server's trinary mode


def test_the_sweeps_of_a_stuck_sensor_are_left_out_counted_and_named(tmp_path: Path) -> None:
    made = paper_survey()
    for one in made[10:15]:
        for reading in one.readings:
            reading.time_of_flight_s = 0.0026
    source = written(made, tmp_path / "survey.jsonl")
    result = noctule_mapper("fit", source, "--contour", tmp_path / "contour.json")
    assert result.exit_code == 0, result.complaint
    assert "left out 5 sweeps" in result.complaint
    assert "survey.jsonl: 11-15" in result.complaint
    assert "unit 'u1'" in result.complaint
    assert "repeats 0.447 m" in result.complaint  # (331.3 + 0.606 * 21) m/s for 0.0026 s, there and back
    assert fit(made) == fit(made[:10] + made[15:])


def test_sweeps_that_can_not_be_read_or_mapped_are_left_out_by_line_and_reason(tmp_path: Path) -> None:
    made = paper_survey()
    lines = [survey.to_json(one) for one in made]
    lines[3] = lines[3][:40]
    lines[7] = lines[7].replace('"air_temperature_c": 2', '"air_temperature_c": 29')
    poseless = Sweep()
    poseless.CopyFrom(made[20])
    poseless.ClearField("pose")
    lines[20] = survey.to_json(poseless)
    source = tmp_path / "survey.jsonl"
    source.write_text("\n".join(lines) + "\n")
    for command in (("fit", source, "--contour", tmp_path / "contour.json"), ("export", source, tmp_path / "a.dxf")):
        result = noctule_mapper(*command)
        assert result.exit_code == 0, result.complaint
        assert "left out 2 sweeps (" + f"{source}: 4, 8): " in result.complaint
        assert "left out 1 sweep (" + f"{source}: 21): " in result.complaint
        assert "has no pose" in result.complaint


def test_the_window_is_the_files_to_set_and_what_was_in_force_lies_beside_the_contour(tmp_path: Path) -> None:
    source = written(paper_survey(), tmp_path / "survey.jsonl")
    parameters, contour = tmp_path / "parameters.toml", tmp_path / "contour.json"
    parameters.write_text('[window]\nmax_sweeps = 30\n[mapper]\nmethod = "hough"\n')
    result = noctule_mapper("fit", source, "--contour", contour, "--config", parameters)
    assert result.exit_code == 0, result.complaint
    assert "left out 14 sweeps" in result.complaint
    assert '"sweeps": "30"' in contour.read_text()
    assert '"hough"' in contour.read_text()
    in_force = load_live(tmp_path / "contour.config.toml")
    assert in_force == load_live(parameters)
    assert in_force != LiveConfig()
    named = noctule_mapper("fit", source, "--contour", contour, "--config", parameters, "--method", "eht-lsm")
    assert named.exit_code == 0
    assert load_live(tmp_path / "contour.config.toml").mapper.method == "eht-lsm"


def test_a_parameter_that_is_none_is_left_out_and_comes_back_as_none(tmp_path: Path) -> None:
    source = written([sweep(1)], tmp_path / "survey.jsonl")
    assert noctule_mapper("fit", source, "--contour", tmp_path / "contour.json").exit_code == 0
    assert load_live(tmp_path / "contour.config.toml") == LiveConfig()
