"""Whatever bytes a stranger sends or a file holds, they are read or refused with the documented error, and no other."""

import io

import pytest
from google.protobuf.message_factory import GetMessageClass
from hypothesis import given, settings
from hypothesis import strategies as st

from noctule import bounds, messages_pb2, survey, survey_mcap
from noctule.errors import BoundsError, SurveyError
from noctule.messages_pb2 import Pose, Reading, Sensor, Sweep

MESSAGES = [GetMessageClass(each) for each in messages_pb2.DESCRIPTOR.message_types_by_name.values()]
SWEEP = Sweep(
    site="room",
    unit="u1",
    log_id="a",
    log_sequence=7,
    pose=Pose(x_m=1.0, heading_rad=0.5),
    sensor=Sensor(beam_width_rad=0.4, range_sigma_m=0.003),
    readings=[Reading(bearing_rad=0.1 * number, time_of_flight_s=0.01) for number in range(3)],
)


@st.composite
def spoiled(draw, whole):
    """Bytes of which some are cut out, doubled or others."""
    for _ in range(draw(st.integers(0, 4))):
        at = draw(st.integers(0, len(whole)))
        to = draw(st.integers(at, min(at + 12, len(whole))))
        whole = whole[:at] + draw(st.binary(max_size=4) | st.just(whole[at:to] * 2)) + whole[to:]
    return whole


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message.DESCRIPTOR.name)
@settings(max_examples=30)
@given(payload=st.binary(max_size=100) | spoiled(SWEEP.SerializeToString()))
def test_a_payload_of_any_bytes_is_within_the_bounds_or_refused(message, payload):
    try:
        made = bounds.decode(message, payload)
    except BoundsError:
        return
    bounds.check(made)


@given(line=spoiled(survey.to_json(SWEEP).encode()))
def test_a_line_of_any_characters_is_a_sweep_or_refused_by_its_number(line):
    for record in survey.read_records(io.StringIO(line.decode(errors="replace"))):
        if isinstance(record.sweep, SurveyError):
            assert str(record.sweep).startswith(f"survey, line {record.number}: ")
        else:
            bounds.check(record.sweep)


def test_a_line_of_a_hundred_thousand_brackets_is_refused():
    with pytest.raises(SurveyError, match="survey, line 1: not"):
        list(survey.read(io.StringIO('{"readings": ' + "[" * 100_000)))


def test_a_byte_order_mark_and_carriage_returns_are_read_over(tmp_path):
    path = tmp_path / "survey.jsonl"
    path.write_bytes(b"\xef\xbb\xbf" + f"{survey.to_json(SWEEP)}\r\n".encode() * 2)
    assert list(survey.read(path)) == [SWEEP, SWEEP]


def recorded():
    stream = io.BytesIO()
    survey_mcap.write([SWEEP, SWEEP], stream)
    return stream.getvalue()


@given(data=spoiled(recorded()))
def test_an_mcap_file_of_any_bytes_is_read_or_refused_by_its_name(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "any.mcap"
    path.write_bytes(data)
    try:
        for record in survey.read_records(path):
            if isinstance(record.sweep, SurveyError):
                assert str(path) in str(record.sweep)
            else:
                bounds.check(record.sweep)
    except SurveyError as error:
        assert str(path) in str(error)


@pytest.mark.parametrize("newer", [b"\xf8\x3f\x01", b"\xfa\x3f\x03abc"])
def test_a_field_of_a_newer_sender_is_read_over(newer):
    """Field 1023, a number and a text."""
    assert bounds.decode(Sweep, SWEEP.SerializeToString() + newer).readings == SWEEP.readings
