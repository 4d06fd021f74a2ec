"""A survey in, a contour out: the message and its JSON."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.json_format import MessageToDict
from mapper.command import noctule_mapper
from mapper.room import paper_path, paper_room, survey

from noctule.errors import SurveyError
from noctule.messages_pb2 import FAULT_KIND_TURNED, Contour, Sweep
from noctule.survey import Record, write
from noctule_mapper.messages import contour_message
from noctule_mapper.readings.sweep import speed_of_sound_m_s
from noctule_mapper.survey_fit import fit, map_survey

PAPER_BIAS_M = 0.0023  # Section V.A


def messages(seed: int) -> list[Sweep]:
    """A survey of the paper's room, biased as the paper's sensor is, at 21 degrees, without any word of the sensor."""
    made = []
    for number, sweep in enumerate(survey(paper_room(), paper_path(), np.random.default_rng(seed))):
        message = Sweep(site="paper", unit="u1", boot=1, sequence=number, air_temperature_c=21.0)
        message.start.seconds = 1_767_225_600 + 3 * number
        message.pose.x_m, message.pose.y_m, message.pose.heading_rad = sweep.x_m, sweep.y_m, sweep.heading_rad
        for bearing, range_m in zip(sweep.bearing_rad, sweep.range_m, strict=True):
            reading = message.readings.add(bearing_rad=bearing)
            if np.isfinite(range_m):
                reading.time_of_flight_s = 2 * (range_m + PAPER_BIAS_M) / speed_of_sound_m_s(21.0)
        made.append(message)
    return made


@pytest.fixture(scope="module")
def contour() -> Contour:
    return fit(messages(21))


def test_the_papers_table_of_walls_comes_out(contour):
    # Table I, theta in 0 to pi and rho in metres, real data. A wall's angle is good to its lever: 0.3 degrees here.
    table = [(1.3248, 1.62658), (2.9226, -2.29996), (1.724, -1.029515), (1.3515, -0.752727), (2.9221, 1.005188)]
    assert len(contour.walls) == 5
    for theta_rad, rho_m in table:
        wall = min(contour.walls, key=lambda wall: abs(wall.rho_m - rho_m) + abs(wall.theta_rad - theta_rad))
        assert wall.theta_rad == pytest.approx(theta_rad, abs=0.006)
        assert wall.rho_m == pytest.approx(rho_m, abs=0.006)


def test_the_contour_says_where_it_comes_from(contour):
    assert (contour.site, contour.method, contour.sweeps) == ("paper", "refined", 44)
    assert contour.time.seconds == 1_767_225_600 + 3 * 43


def test_covariances_are_row_major_and_symmetric(contour):
    for objects, size in ((contour.walls, 2), (contour.corners, 2), (contour.cylinders, 3)):
        for one in objects:
            matrix = np.array(one.covariance).reshape(size, size)
            assert matrix == pytest.approx(matrix.T)
            assert np.linalg.eigvalsh(matrix).min() > 0


def test_its_json_has_the_fields_that_readers_go_by(contour):
    written = json.loads(json.dumps(MessageToDict(contour, preserving_proto_field_name=True)))
    assert {"theta_rad", "rho_m", "start", "end", "covariance", "readings"} <= written["walls"][0].keys()
    assert {"x_m", "y_m"} <= written["walls"][0]["start"].keys()
    assert {"x_m", "y_m", "covariance", "walls"} <= written["corners"][0].keys()
    assert {"x_m", "y_m", "radius_m"} <= written["cylinders"][0].keys()


def test_sweeps_of_two_sites_are_refused():
    with pytest.raises(SurveyError, match="several sites"):
        fit([*messages(1)[:1], Sweep(site="elsewhere", pose=messages(1)[0].pose)])


def test_an_empty_survey_is_an_empty_contour():
    assert len(fit([]).walls) == 0


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "survey.jsonl"
    with path.open("w") as stream:
        write(messages(22), stream)
    return path


@pytest.mark.parametrize("method", ["hough", "eht-lsm"])
def test_the_papers_methods_are_there_for_the_asking(method: str, file: Path):
    result = noctule_mapper("fit", file, "--contour", file.with_name("contour.json"), "--method", method)
    assert result.exit_code == 0, result.complaint
    written = json.loads(file.with_name("contour.json").read_text())
    assert written["method"] == method
    assert len(written["walls"]) == 5
    assert len(written["cylinders"]) == 1


def test_the_rule_of_fusion_is_there_for_the_asking(file: Path):
    options = ("--contour", file.with_name("contour.json"), "--method", "eht-lsm")
    assert noctule_mapper("fit", file, *options, "--rule", "dempster").exit_code == 0
    assert len(json.loads(file.with_name("contour.json").read_text())["walls"]) == 5
    refused = noctule_mapper("fit", file, *options, "--rule", "bayes")
    assert refused.exit_code == 2
    assert "pcr6+" in refused.complaint


def test_what_each_reading_touched_is_written_with_both_verdicts(file: Path):
    table = file.with_name("contacts.csv")
    noctule_mapper("fit", file, "--contour", file.with_name("contour.json"), "--contacts", table)
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert len(rows) == sum(reading.HasField("time_of_flight_s") for one in messages(22) for reading in one.readings)
    assert {row["kind"] for row in rows} == {"none", "wall", "cylinder", "corner"}
    tested = [row for row in rows if row["r2d_kind"] != "none"]
    assert len(tested) > 30
    for row in tested:
        below = abs(float(row["r2d_deviation_m"])) < float(row["r2d_threshold_m"])
        assert row["r2d_kind"] == ("wall" if below else "cylinder")


def test_sweeps_of_a_faulty_unit_and_those_just_before_are_left_out_and_named() -> None:
    survey = messages(1)
    for number, sweep in enumerate(survey, start=1):
        sweep.log_id, sweep.log_sequence = "log", number
    for sweep in survey[29:34]:
        sweep.faults.append(FAULT_KIND_TURNED)
    survey[29].suspect_before = 3
    surveyed = map_survey(Record("attic.jsonl", number, sweep) for number, sweep in enumerate(survey, start=1))
    before, during = surveyed.left_out
    assert str(before).startswith(
        "left out 3 sweeps (attic.jsonl: 27-29): sweep 27 of 'log' is of the sweeps just before"
    )
    assert str(during).startswith(
        "left out 5 sweeps (attic.jsonl: 30-34): sweep 30 of 'log' (unit 'u1'): its gateway had"
    )
    assert contour_message(surveyed.mapper.contour(), site="paper") == fit(survey[:26] + survey[34:])
