"""noctule-mapper fit as people type it: a survey in, a contour and a table out, one clear line where that can't be."""

from pathlib import Path

import pytest
from google.protobuf import json_format
from mapper.command import Result, noctule_mapper
from mapper.live_site import paper_survey

from noctule import survey
from noctule.messages_pb2 import Contour


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "survey.jsonl"
    with path.open("w") as stream:
        survey.write(paper_survey(), stream)
    return path


def fit(file: Path, *options: str) -> Result:
    return noctule_mapper("fit", file, "--contour", file.with_name("contour.json"), *options)


def contour_beside(file: Path) -> Contour:
    return json_format.Parse(file.with_name("contour.json").read_text(), Contour())


def test_a_survey_becomes_a_file_and_a_table(file: Path) -> None:
    result = fit(file)
    assert result.exit_code == 0, result.complaint
    contour = contour_beside(file)
    # Liu et al. 2019, Tables I and III: five walls, and one cylinder of radius 44.8 cm.
    assert (len(contour.walls), len(contour.cylinders)) == (5, 1)
    walls, corners, cylinders = result.output.rstrip().split("\n\n")
    assert [line.split()[0] for line in walls.splitlines()] == ["wall", "1", "2", "3", "4", "5"]
    assert len(corners.splitlines()) == 1 + len(contour.corners)
    radius_m = float(cylinders.splitlines()[1].split()[4])
    assert radius_m == pytest.approx(0.448, abs=0.005)


def test_a_folder_that_is_not_there_is_named_before_anything_is_computed(tmp_path: Path) -> None:
    result = noctule_mapper("fit", tmp_path / "no-survey.jsonl", "--contour", tmp_path / "none" / "contour.json")
    assert result.exit_code == 1 and "there is no folder" in result.complaint


@pytest.mark.parametrize(
    ("option", "name", "meant"),
    [
        ("--contour", "map.geojson", "map.json"),
        ("--contacts", "contacts.xlsx", "contacts.csv"),
        ("--svg", "map.pdf", "map.svg"),
        ("--rrd", "map.mcap", "map.rrd"),
    ],
)
def test_a_name_of_another_kind_of_file_is_refused_before_anything_is_read(option: str, name: str, meant: str) -> None:
    result = noctule_mapper("fit", "no-survey.jsonl", option, name)
    assert result.exit_code == 2
    assert f"name it {meant}" in " ".join(result.complaint.replace("│", " ").split())


def test_a_calibration_in_a_file_takes_the_place_of_what_sweeps_leave_out(file: Path, tmp_path: Path) -> None:
    uncalibrated = paper_survey()
    for sweep in uncalibrated:
        sweep.ClearField("sensor")
    with file.open("w") as stream:
        survey.write(uncalibrated, stream)
    sensor = tmp_path / "sensor.toml"
    radii_m = []
    for bias_m in (0.0, 0.05):
        sensor.write_text(f"beam_width_deg = 22.5\nrange_bias_m = {bias_m}\nrange_sigma_m = 0.0032\n")
        assert fit(file, "--sensor", str(sensor)).exit_code == 0
        radii_m.append(contour_beside(file).cylinders[0].radius_m)
    assert radii_m[1] - radii_m[0] == pytest.approx(0.05, abs=0.01), (
        "ranges shorter by 5 cm make a cylinder as much larger"
    )


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("{", "survey.jsonl, line 1: not JSON"),
        ('{"site": "paper-room", "unit": "u1"}', "has no pose"),
    ],
)
def test_a_survey_that_can_not_be_fitted_is_told_in_one_line(file: Path, line: str, complaint: str) -> None:
    file.write_text(line + "\n")
    result = fit(file)
    assert result.exit_code == 1
    assert complaint in result.complaint
    assert result.complaint.startswith("noctule-mapper: ")
    assert result.complaint.count("\n") == 1


def test_a_survey_that_is_not_there_is_told_in_one_line(tmp_path: Path) -> None:
    result = fit(tmp_path / "nowhere.jsonl")
    assert result.exit_code == 1
    assert "nowhere.jsonl can't be read" in result.complaint
    assert result.complaint.count("\n") == 1
