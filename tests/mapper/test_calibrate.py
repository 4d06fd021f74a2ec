"""noctule-mapper calibrate: the paper's calibration (Liu et al. 2019, Section V.A) gives back what the sensor was."""

import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from mapper.command import Result, noctule_mapper
from mapper.wall_survey import FIRST_M, MEAN_M, SIGMA_M, gaussian, ranges_m, sweeps, uniform

from mapper import wall_survey
from noctule import survey
from noctule.messages_pb2 import Sweep
from noctule_mapper.calibration.calibrate import Calibration, calibrate
from noctule_mapper.calibration.screening import CYCLE_M
from noctule_mapper.calibration.wall_readings import CalibrationError
from noctule_mapper.live.config import load_sensor
from noctule_mapper.readings.sweep import from_message

SITE = """# Of the workshop's end wall.
site = "bench"   # its name

[sensor] # as calibrated in spring
beam_width_deg = 22.5
range_sigma_m = 0.5   # a guess

# The units.
[[unit]]
name = "u1"
serial = 1
address = "/dev/ttyUSB0"
pose = "key"

[[unit]]
name = "u2" # has its own
serial = 2
address = "/dev/ttyUSB1"
pose = "key"
[unit.sensor]
range_sigma_m = 0.002 # by its maker
"""


def calibrated(seen_m: np.ndarray, distance_m: float | None = FIRST_M) -> Calibration:
    """From sweeps of all repeats at one place, which give the same as sweeps of one reading each (test below)."""
    return calibrate(readings_of(sweeps(seen_m, readings_per_sweep=wall_survey.REPEATS)), distance_m)


def readings_of(messages: list[Sweep]):
    for message in messages:
        message.sensor.range_bias_m = 0.0
    return [from_message(message) for message in messages]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write(tmp_path / "wall.jsonl", sweeps(ranges_m(1)))


def write(path: Path, messages: list[Sweep]) -> Path:
    with path.open("w") as stream:
        survey.write(messages, stream)
    return path


def command(file: Path, *options: object) -> Result:
    result = noctule_mapper("calibrate", file, *options)
    assert result.exit_code == 0, result.complaint
    return result


# ---- What comes out of the readings


def test_sigma_and_mean_error_come_out_within_their_standard_errors():
    found = [calibrated(ranges_m(seed)) for seed in range(100, 110)]
    sigma = [(each.spread.sigma_range_m.value - SIGMA_M) / each.spread.sigma_range_m.error for each in found]
    mean = [(each.mean_error_m.value - MEAN_M) / each.mean_error_m.error for each in found if each.mean_error_m]
    # Ten normalised errors each: their mean square is chi-square of 10 over 10, within 0.13 to 3.1 in 999 of 1000.
    assert 0.13 < np.mean(np.square(sigma)) < 3.1
    assert 0.13 < np.mean(np.square(mean)) < 3.1
    # 588 degrees of freedom make sigma good to 1 / sqrt(2 * 588) = 2.9 %.
    assert np.mean([each.spread.sigma_range_m.error for each in found]) == pytest.approx(0.029 * SIGMA_M, rel=0.1)


def test_the_threshold_is_the_sigma_of_d_which_is_1_22_of_a_ranges():
    spread = calibrated(ranges_m(2)).spread
    assert (spread.triples, len(spread.deviation_m)) == (12, 600)
    assert spread.sigma_d_m.value == pytest.approx(math.sqrt(1.5) * spread.sigma_range_m.value)
    assert spread.sigma_d_m.value == pytest.approx(float(spread.deviation_m.std()), rel=0.02)
    assert abs(spread.mean_d_m.value) < 4 * spread.mean_d_m.error, "a mean error of the ranges cancels in d"


def test_the_middle_place_need_not_be_in_the_middle():
    # Two ninths and seven ninths of the way: d has sqrt(1 + (2/9)^2 + (7/9)^2) sigmas of a range.
    messages = sweeps(ranges_m(3, gaussian))
    along = np.array([-math.sin(wall_survey.FACING_RAD), math.cos(wall_survey.FACING_RAD)])
    for number, message in enumerate(messages):
        if number // wall_survey.REPEATS % 3 == 1:
            message.pose.x_m -= 0.111111 * along[0]
            message.pose.y_m -= 0.111111 * along[1]
    spread = calibrate(readings_of(messages)).spread
    assert spread.sigma_d_m.value / spread.sigma_range_m.value == pytest.approx(
        math.sqrt(1 + (2 / 9) ** 2 + (7 / 9) ** 2), rel=1e-3
    )
    assert spread.sigma_range_m.value == pytest.approx(SIGMA_M, abs=4 * spread.sigma_range_m.error)


def test_gaussian_errors_pass_for_gaussian_and_uniform_ones_do_not():
    passed = [calibrated(ranges_m(seed)).spread for seed in range(200, 210)]
    failed = [calibrated(ranges_m(seed, uniform)).spread for seed in range(200, 203)]
    assert sum(min(each.gaussian_range_p, each.gaussian_d_p) < 0.01 for each in passed) <= 2
    assert all(each.gaussian_range_p < 1e-6 for each in failed)


def test_without_the_walls_distance_the_mean_error_is_left_out():
    calibration = calibrated(ranges_m(4), None)
    assert calibration.mean_error_m is None
    assert calibration.spread.sigma_range_m.value == calibrated(ranges_m(4)).spread.sigma_range_m.value


def test_repeats_may_be_readings_of_one_sweep():
    seen_m = ranges_m(5)
    of_sweeps, of_readings = (
        calibrate(readings_of(sweeps(seen_m, readings_per_sweep=count)), FIRST_M) for count in (1, wall_survey.REPEATS)
    )
    assert of_readings.spread.sigma_range_m == of_sweeps.spread.sigma_range_m
    assert of_readings.mean_error_m == of_sweeps.mean_error_m


def test_late_readings_are_told_from_good_ones_where_the_spread_lets_them():
    def one_in_twenty_late(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
        return rng.normal(MEAN_M, 0.001, shape) + CYCLE_M * (rng.random(shape) < 0.05)

    calibration = calibrated(ranges_m(6, one_in_twenty_late))
    assert calibration.screening.late_share == pytest.approx(0.05, abs=0.02)
    assert calibration.spread.sigma_range_m.value == pytest.approx(0.001, rel=0.1)
    assert calibration.mean_error_m is not None
    assert calibration.mean_error_m.value == pytest.approx(MEAN_M, abs=0.0002)
    assert calibrated(ranges_m(6)).screening.late_share is None, "4.3 mm are lost in a sigma of 3.2 mm"


def test_readings_of_something_else_are_left_out():
    def one_in_twenty_false(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
        return np.where(rng.random(shape) < 0.05, rng.uniform(0.1, 1.0, shape), gaussian(rng, shape))

    calibration = calibrated(ranges_m(7, one_in_twenty_false))
    assert calibration.screening.elsewhere == pytest.approx(0.05 * 1800, abs=40)
    assert calibration.spread.sigma_range_m.value == pytest.approx(SIGMA_M, rel=0.12)


def test_a_place_that_faces_something_else_costs_its_triple_and_nothing_more():
    seen_m = ranges_m(8)
    seen_m[13] -= 0.2
    calibration = calibrated(seen_m)
    assert (calibration.spread.triples, calibration.spread.triples_off_wall) == (11, 1)
    assert calibration.mean_error_m is not None
    assert calibration.mean_error_m.value == pytest.approx(MEAN_M, abs=4 * calibration.mean_error_m.error)


def test_places_that_were_laid_out_badly_are_told_and_do_not_widen_sigma():
    laid_out = np.random.default_rng(9).normal(0, 0.003, (36, 1))
    spread = calibrated(ranges_m(9) + laid_out).spread
    assert spread.placement_p < 1e-3
    assert spread.placement_m == pytest.approx(math.sqrt(1.5) * 0.003, rel=0.5)
    assert spread.sigma_range_m.value == pytest.approx(SIGMA_M, rel=0.12)
    assert calibrated(ranges_m(9)).spread.placement_p > 0.01


# ---- What can't be calibrated


def test_too_few_triples_are_refused():
    messages = sweeps(ranges_m(1))[: 6 * wall_survey.REPEATS]
    assert calibrate(readings_of(messages)).spread.triples == 2
    for few in (messages[: 2 * wall_survey.REPEATS], messages[::5]):
        with pytest.raises(CalibrationError, match=r"too few .* groups of three places"):
            calibrate(readings_of(few))


def test_readings_that_were_not_repeated_are_refused():
    with pytest.raises(CalibrationError, match="repeat the reading at each place"):
        calibrate(readings_of(sweeps(ranges_m(1))[:: wall_survey.REPEATS]))


def test_a_distance_that_the_readings_can_not_have_is_refused():
    with pytest.raises(CalibrationError, match=r"0\.30\d m from the survey's first place, not 2\.500 m"):
        calibrated(ranges_m(1), 2.5)


def test_of_several_directions_the_walls_must_be_named():
    messages = sweeps(ranges_m(1))
    for message in messages:
        message.readings.add(bearing_rad=0.5 + math.pi / 2, time_of_flight_s=0.01)
    with pytest.raises(CalibrationError, match=r"several directions .*40, 130 degrees.*--facing-deg"):
        calibrate(readings_of(messages))
    named = calibrate(readings_of(messages), FIRST_M, wall_survey.FACING_RAD)
    alone = calibrated(ranges_m(1))
    assert named.spread.sigma_range_m.value == pytest.approx(alone.spread.sigma_range_m.value)
    assert named.spread.sigma_range_m.error == pytest.approx(alone.spread.sigma_range_m.error)


# ---- The command and the files that it writes


def test_the_table_tells_what_the_paper_tells(file):
    lines = command(file, "--wall-distance", FIRST_M).output.splitlines()
    row = {line[:32].rstrip(): line[32:].strip() for line in lines}
    assert 3.4 < float(row["d, sigma: the threshold Th"].split()[0]) < 4.4  # mm: 1.22 * 3.2
    assert 2.8 < float(row["range, sigma"].split()[0]) < 3.6
    assert 5.6 < float(row["epsilon, 2 sigma"].split()[0]) < 7.2
    assert 1.8 < float(row["range, mean error"].split()[0]) < 2.8
    assert row["Gaussian? range"].startswith("yes")
    # Eq. 25 corrected and as printed, l = 20 cm: 4.8 and 2.25 m at d = 1.22 * 3.2 mm, larger as d is found smaller.
    radius, printed = re.findall(r"radius (\d\.\d\d) m", row["largest cylinder told at 0.3 m"])
    assert 0.2**2 / (2 * 0.0044) - 0.3 < float(radius) < 0.2**2 / (2 * 0.0034) - 0.3
    assert 0.2**2 / (4 * 0.0044) - 0.3 < float(printed) < 0.2**2 / (4 * 0.0034) - 0.3


def test_the_table_asks_for_the_distance_where_it_was_not_given(file):
    output = command(file).output
    assert "not known" in output
    assert "--wall-distance" in output


def test_the_site_file_gets_the_calibration_and_keeps_all_else(file, tmp_path):
    site = tmp_path / "site.toml"
    site.write_text(SITE)
    result = command(file, "--wall-distance", FIRST_M, "--site", site)
    sensor = tomllib.loads(site.read_text())["sensor"]
    assert sensor["range_sigma_m"] == pytest.approx(SIGMA_M, rel=0.12)
    assert sensor["range_bias_m"] == pytest.approx(MEAN_M, abs=0.0005)
    kept = [line for line in site.read_text().splitlines() if not line.startswith("range_bias_m = 0.00")]
    was = SITE.splitlines()
    changed = [(old, new) for old, new in zip(was, kept, strict=True) if old != new]
    assert changed == [(was[5], f"range_sigma_m = {sensor['range_sigma_m']}   # a guess")]
    assert "These have their own: u2" in result.output


def test_a_units_own_sensor_is_written_where_the_unit_is_named(tmp_path):
    site = tmp_path / "site.toml"
    site.write_text(SITE)
    command(write(tmp_path / "u2.jsonl", sweeps(ranges_m(1), unit="u2")), "--unit", "u2", "--site", site)
    before, after = tomllib.loads(SITE), tomllib.loads(site.read_text())
    assert after["unit"][1]["sensor"].pop("range_sigma_m") == pytest.approx(SIGMA_M, rel=0.12)
    del before["unit"][1]["sensor"]["range_sigma_m"]
    assert after == before
    assert "# by its maker" in site.read_text()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (SITE.replace('"bench"', "3"), "site is 3"),
        ("[", "is not a TOML file"),
        (SITE.replace('"u1"', '"u7"'), "has no unit 'u1'"),
    ],
)
def test_a_site_file_that_can_not_be_written_stays_as_it_is(file, tmp_path, text, complaint):
    site = tmp_path / "site.toml"
    site.write_text(text)
    result = noctule_mapper("calibrate", file, "--site", site, "--unit", "u1")
    assert result.exit_code == 1
    assert complaint in result.complaint
    assert result.complaint.count("\n") == 1
    assert site.read_text() == text
    assert {each.name for each in tmp_path.iterdir()} == {"wall.jsonl", "site.toml"}


def test_fit_takes_the_file_that_out_names(file, tmp_path):
    command(file, "--wall-distance", FIRST_M, "--out", tmp_path / "sensor.toml")
    sensor = load_sensor(tmp_path / "sensor.toml")
    assert sensor.range_sigma_m == pytest.approx(SIGMA_M, rel=0.12)
    assert sensor.range_bias_m == pytest.approx(MEAN_M, abs=0.0005)


def test_a_wrong_folder_is_told_before_the_survey_is_read(tmp_path):
    result = noctule_mapper("calibrate", tmp_path / "none.jsonl", "--out", tmp_path / "none" / "sensor.toml")
    assert result.exit_code == 1 and "there is no folder" in result.complaint


def test_a_survey_of_several_units_asks_which(tmp_path):
    both = write(tmp_path / "both.jsonl", sweeps(ranges_m(1)) + sweeps(ranges_m(2), unit="u2"))
    result = noctule_mapper("calibrate", both)
    assert (result.exit_code, "bench/u1, bench/u2" in result.complaint) == (1, True)
    assert "1800 readings" in command(both, "--unit", "u2").output


def test_a_survey_that_holds_sweeps_twice_counts_them_once(file):
    file.write_text(file.read_text() * 2)
    assert "1800 readings" in command(file).output


def test_a_stated_face_offset_is_no_part_of_the_mean_error_nor_an_unstated_one_missing_from_it(tmp_path):
    """The wall is measured from the axis, 2 cm behind the face from which the ranges of this survey count."""
    for stated_m, expected_m in ((0.02, MEAN_M), (None, MEAN_M - 0.02)):
        messages = sweeps(ranges_m(1))
        for message in messages:
            message.sensor.Clear()
            if stated_m is not None:
                message.sensor.face_offset_m = stated_m
        out = tmp_path / "sensor.toml"
        command(write(tmp_path / "wall.jsonl", messages), "--wall-distance", FIRST_M + 0.02, "--out", out)
        assert load_sensor(out).range_bias_m == pytest.approx(expected_m, abs=0.0005)
