"""Files of parameters: what they may say, and what is said of those that can't be used."""

import math
from pathlib import Path

import pytest

from noctule_mapper.live.config import ConfigFileError, LiveConfig, load_live, load_sensor, to_toml


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "parameters.toml"


def test_what_a_file_leaves_out_keeps_its_default(file: Path) -> None:
    file.write_text("[window]\nmax_age_s = 60.0\n[mapper.grid]\ncell_m = 0.05\n")
    loaded = load_live(file)
    assert (loaded.window.max_age_s, loaded.mapper.grid.cell_m) == (60.0, 0.05)
    assert loaded.window.max_sweeps == LiveConfig().window.max_sweeps
    assert loaded.pace == LiveConfig().pace


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[window]\nmax_age = 60", "window.max_age is not known: did you mean max_age_s?"),
        ("[pace]\nmost_time_share = 2.0", "pace.most_time_share is 2.0: give 1.0 or less"),
        ("[window]\nplace_radius_m = 0.0", "window.place_radius_m is 0.0: give more than 0.0"),
        ("[window", "is not a TOML file"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_by_name_and_field(file: Path, text: str, complaint: str) -> None:
    file.write_text(text)
    with pytest.raises(ConfigFileError) as caught:
        load_live(file)
    assert str(file) in str(caught.value)
    assert complaint in str(caught.value)


def test_a_file_that_is_not_there_is_told_by_its_name(file: Path) -> None:
    with pytest.raises(ConfigFileError, match=r"parameters\.toml can't be read"):
        load_live(file)


@pytest.mark.parametrize("width", ["beam_width_deg = 22.5", "beam_width_rad = 0.39269908169872414"])
def test_a_sensors_beam_may_be_given_in_degrees_or_radians(file: Path, width: str) -> None:
    file.write_text(f"{width}\nrange_bias_m = 0.001\nrange_sigma_m = 0.002\n")
    sensor = load_sensor(file)
    assert sensor.beam_width_rad == pytest.approx(math.pi / 8)
    assert (sensor.range_bias_m, sensor.range_sigma_m) == (0.001, 0.002)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("beam_width_deg = 20.0\nbeam_width_rad = 0.3", "one quantity"),
        ('beam_width_deg = "wide"', "should be a number"),
        ("range_sigma_m = -0.1", "range_sigma_m is -0.1: give more than 0.0"),
    ],
)
def test_a_calibration_that_makes_no_sense_is_refused(file: Path, text: str, complaint: str) -> None:
    file.write_text(text)
    with pytest.raises(ConfigFileError, match=complaint):
        load_sensor(file)


def test_the_parameters_that_are_written_are_those_that_are_read(file: Path) -> None:
    file.write_text('[window]\nmax_age_s = 60.0\n[mapper]\nmethod = "eht-lsm"\n[mapper.sensor]\nrange_sigma_m = 1e-4\n')
    config = load_live(file)
    file.write_text(to_toml(config))
    assert load_live(file) == config != LiveConfig()
