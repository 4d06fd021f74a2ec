"""Sweeps survive a file, and a file that can't be read says where."""

import io
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from noctule import survey
from noctule.errors import SurveyError
from noctule.messages_pb2 import Pose, Reading, ReadingStatus, Sweep

NAMES = st.from_regex(r"[a-z0-9][a-z0-9_-]{0,20}", fullmatch=True) | st.just("")
READINGS = st.builds(
    Reading,
    bearing_rad=st.floats(-math.pi, math.pi),
    time_offset_s=st.floats(0, 60),
    time_of_flight_s=st.none() | st.floats(0, 0.25),
    status=st.sampled_from(ReadingStatus.values()),
)
SWEEPS = st.builds(
    Sweep,
    site=NAMES,
    unit=NAMES,
    log_id=st.text(max_size=64),
    log_sequence=st.integers(0, 2**53 - 1),
    boot=st.integers(0, 2**32 - 1),
    pose=st.none() | st.builds(Pose, x_m=st.floats(-1e4, 1e4), heading_rad=st.floats(-math.pi, math.pi)),
    waypoint=st.none() | st.integers(0, 2**16 - 1),
    air_temperature_c=st.none() | st.floats(-60, 85),
    readings=st.lists(READINGS, max_size=5),
)


@given(st.lists(SWEEPS, max_size=5))
def test_sweeps_come_out_of_json_lines_as_they_went_in(sweeps):
    stream = io.StringIO()
    survey.write(sweeps, stream)
    stream.seek(0)
    assert list(survey.read(stream)) == sweeps


def test_sweeps_come_out_of_mcap_as_they_went_in_and_its_schema_is_inside(tmp_path):
    from mcap.reader import make_reader

    from noctule import survey_mcap

    sweeps = [
        Sweep(site="room", unit=unit, log_sequence=n, readings=[Reading()] * n) for n in range(3) for unit in ("a", "b")
    ]
    path = tmp_path / "survey.mcap"
    with path.open("wb") as stream:
        survey_mcap.write(sweeps, stream)
    assert list(survey.read(path)) == sweeps
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert {channel.topic for channel in summary.channels.values()} == {
        "noctule/@v1/room/unit/a/sweep",
        "noctule/@v1/room/unit/b/sweep",
    }
    assert [schema.name for schema in summary.schemas.values()] == ["noctule.v1.Sweep"]


def test_fields_at_zero_are_written_out_and_unset_ones_are_not():
    line = survey.to_json(Sweep(readings=[Reading(bearing_rad=0.5)]))
    assert '"time_offset_s": 0.0' in line and '"clock_error_s": 0.0' in line
    assert "time_of_flight_s" not in line and "\n" not in line


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("{", r"line 3: not JSON \(.*column 2\)"),
        ("[1, 2]", "line 3: not a Sweep"),
        ('{"units": "u1"}', "line 3: not a Sweep: it has 'units', and the fields of a Sweep are site, unit, log_id"),
        ('{"version": 3, "walls": []}', "line 3: this is a Contour, and a survey holds Sweeps"),
        ('{"boot": -1}', "line 3: not a Sweep: .*boot"),
        ('{"clock_error_s": "NaN"}', "line 3: clock_error_s is nan: give 0 to"),
        ('{"readings": [{}, {"bearing_rad": "-Infinity"}]}', r"line 3: readings\[1\]\.bearing_rad is -inf"),
        ('{"pose": {"x_m": "Infinity"}}', r"line 3: pose\.x_m is inf: give -10000 to 10000 m"),
    ],
)
def test_a_bad_line_is_told_by_number_after_the_good_ones_were_read(tmp_path, line, told):
    path = tmp_path / "survey.jsonl"
    path.write_text(f'{{"unit": "u1"}}\n\n{line}\n')
    sweeps = survey.read(path)
    assert next(sweeps).unit == "u1"
    with pytest.raises(SurveyError, match=told) as error:
        next(sweeps)
    assert str(error.value).startswith(str(path))


def test_a_number_beyond_its_bounds_is_not_written():
    with pytest.raises(SurveyError, match=r"readings\[0\]\.time_of_flight_s"):
        survey.write([Sweep(readings=[Reading(time_of_flight_s=float("nan"))])], io.StringIO())


@pytest.mark.parametrize("name", ["none.jsonl", "none.mcap"])
def test_a_file_that_is_not_there_is_told(tmp_path, name):
    with pytest.raises(SurveyError, match=f"{name} can't be read: No such file"):
        list(survey.read(tmp_path / name))


@pytest.mark.parametrize(("name", "told"), [("x.mcap", "not a whole MCAP file"), ("x.jsonl", r"not text \(byte 0\)")])
def test_a_file_of_another_kind_is_told(tmp_path, name, told):
    (tmp_path / name).write_bytes(b"\x80\xff not a survey")
    with pytest.raises(SurveyError, match=told):
        list(survey.read(tmp_path / name))


def test_a_sweep_that_can_not_be_read_does_not_end_the_records(tmp_path):
    path = tmp_path / "survey.jsonl"
    path.write_text('{"unit": "u1"}\n\n{\n{"unit": "u2"}\n{"boot": -1}\n')
    first, broken, second, wrong = survey.read_records(path)
    assert (first.source, first.number, first.sweep) == (str(path), 1, Sweep(unit="u1"))
    assert (second.number, second.sweep) == (4, Sweep(unit="u2"))
    assert broken.number == 3 and "line 3: not JSON" in str(broken.sweep)
    assert wrong.number == 5 and "line 5: not a Sweep" in str(wrong.sweep)


def test_a_sweep_beyond_its_bounds_in_an_mcap_file_does_not_end_the_records(tmp_path):
    from noctule import survey_mcap

    path = tmp_path / "survey.mcap"
    with path.open("wb") as stream:
        survey_mcap.write([Sweep(site="room", unit="a", clock_error_s=n) for n in (1.0, -1.0, 2.0)], stream)
    first, wrong, last = survey.read_records(path)
    good = [Sweep(site="room", unit="a", clock_error_s=n) for n in (1.0, 2.0)]
    assert [first.sweep, last.sweep] == good and last.number == 3
    assert isinstance(wrong.sweep, SurveyError) and f"{path}, sweep 2: clock_error_s is -1" in str(wrong.sweep)
    with pytest.raises(SurveyError, match="sweep 2: clock_error_s"):
        list(survey.read(path))
