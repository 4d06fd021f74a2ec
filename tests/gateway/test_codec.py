"""Frames to bytes and back, and over a bad line. The vectors are shared with the firmware's codec."""

import json
import zlib
from contextlib import suppress
from pathlib import Path
from typing import get_args

import pytest
from cobs import cobs
from gateway.bad_line import BadLine, Faults
from hypothesis import given
from hypothesis import strategies as st

from noctule_gateway.errors import FrameError
from noctule_gateway.wire import frames
from noctule_gateway.wire.codec import MAX_FRAME_BYTES, FrameReader, UnknownFrameError, decode, encode
from noctule_gateway.wire.frames import Frame, Reading, Sweep, Sweep2

VECTORS = json.loads((Path(__file__).parents[1] / "firmware" / "vectors" / "frames.json").read_text())
TYPES = {frame_type.TYPE: frame_type for frame_type in get_args(Frame)}

readings = st.builds(
    Reading,
    bearing=st.integers(-32768, 32767),
    offset=st.integers(0, 0xFFFFFF),
    echo=st.integers(0, 0xFFFFFF),
)
u32 = st.integers(0, 0xFFFFFFFF)
names2 = {"boot": st.integers(0, 0xFFFF), "sequence": u32}
names = {**names2, "serial": u32, "life": u32}
content = {
    "start": st.integers(0, 2**48 - 1),
    "waypoint": st.integers(0, 0xFFFF),
    "temperature": st.integers(-32768, 32767),
    "flags": st.integers(0, 255),
    "readings": st.lists(readings, max_size=frames.MAX_READINGS).map(tuple),
}
sweeps = st.builds(Sweep, **names, **content) | st.builds(Sweep2, **names2, **content)
clocks = st.builds(
    frames.Clock,
    request=st.integers(0, 255),
    received=st.integers(0, 2**48 - 1),
    sent=st.integers(0, 2**48 - 1),
)
some_frames = sweeps | clocks | st.builds(frames.Ack, **names) | st.builds(frames.Ack2, **names2)


def frame_of(vector: dict) -> Frame:
    values = dict(vector["fields"])
    if vector["type"] == frames.Hello.TYPE:
        values |= dict(zip(("version_major", "version_minor", "version_patch"), values.pop("version"), strict=True))
    if vector["type"] == frames.Loader.TYPE:
        parts = ("application_major", "application_minor", "application_patch")
        values |= dict(zip(parts, values.pop("application"), strict=True))
    if vector["type"] == frames.Put.TYPE:
        values["data"] = bytes.fromhex(values["data"])
    if vector["type"] in (Sweep.TYPE, Sweep2.TYPE):
        values["readings"] = tuple(Reading(**reading) for reading in values["readings"])
        values.pop("count", None)
    if vector["type"] == frames.For.TYPE:
        order = values["order"]
        values["order"] = TYPES[order["type"]](**{name: value for name, value in order.items() if name != "type"})
    return TYPES[vector["type"]](**values)


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: vector["name"])
def test_agrees_with_the_firmware_on_every_shared_vector(vector: dict) -> None:
    frame = frame_of(vector)
    wire = bytes.fromhex(vector["wire"])
    assert encode(frame) == wire
    assert decode(wire[:-1]) == frame


@pytest.mark.parametrize("inside", [b"", b"\x01\x01\x03", b"\x7f\x01", b"\x05\x04", b"\x06\x04\x00"])
def test_a_frame_that_names_its_unit_and_holds_no_whole_order_can_not_be_read(inside: bytes) -> None:
    content = bytes([frames.For.TYPE]) + bytes(8) + inside
    with pytest.raises(FrameError):
        decode(cobs.encode(content + zlib.crc32(content).to_bytes(4, "little")))


def test_the_shared_vectors_hold_every_type_of_the_table() -> None:
    assert {vector["type"] for vector in VECTORS} == set(TYPES)


@given(some_frames)
def test_a_frame_decodes_to_what_was_encoded(frame: Frame) -> None:
    wire = encode(frame)
    assert wire.count(0) == 1
    assert wire.endswith(b"\0")
    assert decode(wire[:-1]) == frame


@given(st.lists(some_frames, min_size=1, max_size=4), st.integers(1, 7))
def test_frames_come_whole_however_the_line_cuts_them(sent: list[Frame], piece: int) -> None:
    reader = FrameReader()
    wire = b"".join(map(encode, sent))
    pieces = (wire[at : at + piece] for at in range(0, len(wire), piece))
    assert [frame for part in pieces for frame in reader.feed(part)] == sent
    assert reader.frames_bad == 0


@given(st.binary(max_size=2000), sweeps)
def test_garbage_costs_no_frame_after_its_end(garbage: bytes, sweep: Sweep) -> None:
    reader = FrameReader()
    found = reader.feed(garbage + b"\0" + encode(sweep))
    assert found[-1] == sweep


def test_a_line_that_loses_a_fifth_of_its_bytes_delivers_only_true_frames() -> None:
    line = BadLine(Faults(lost=0.2), seed=20)
    reader = FrameReader()
    sent = [frames.Ack2(boot=3, sequence=number) for number in range(3000)]
    for frame in sent:
        line.write(encode(frame), 0.0)
    found = reader.feed(line.read(0.0))
    # 13 bytes on the line, all of which must come: 0.8^13 = 5.5 %.
    assert 110 < len(found) < 220
    assert set(found) <= set(sent)
    assert reader.frames_bad > 1000


def test_a_flood_without_an_end_is_counted_once_and_kept_out_of_memory() -> None:
    reader = FrameReader()
    for _ in range(1000):
        assert reader.feed(b"\x55" * 100) == []
    assert reader.frames_bad == 1
    assert reader.feed(b"\0" + encode(frames.Ack2(1, 2))) == [frames.Ack2(1, 2)]


def test_a_sound_frame_of_an_unknown_type_is_told_from_a_bad_one() -> None:
    body = b"\x7f\x01"
    wire = cobs.encode(body + zlib.crc32(body).to_bytes(4, "little"))
    with pytest.raises(UnknownFrameError, match="0x7f"):
        decode(wire)
    reader = FrameReader()
    assert reader.feed(wire + b"\0") == []
    assert (reader.frames_unknown, reader.frames_bad) == (1, 0)


def test_a_frame_of_the_wrong_length_is_refused() -> None:
    body = bytes([frames.Result.TYPE, 1, 2, 3, 4])
    with pytest.raises(FrameError, match="Result of 4 bytes instead of 3"):
        decode(cobs.encode(body + zlib.crc32(body).to_bytes(4, "little")))


@pytest.mark.parametrize("number", TYPES)
def test_a_frame_of_any_length_is_read_or_refused(number: int) -> None:
    for length in range(MAX_FRAME_BYTES + 1):
        body = bytes([number]) + bytes(length)
        with suppress(FrameError):
            frame = decode(cobs.encode(body + zlib.crc32(body).to_bytes(4, "little")))
            assert isinstance(frame, TYPES[number])


def test_a_value_that_does_not_fit_is_refused_before_it_is_sent() -> None:
    with pytest.raises(FrameError, match="does not fit"):
        encode(frames.Ack2(boot=0x10000, sequence=0))
    with pytest.raises(FrameError, match="at most 64"):
        encode(Sweep(1, 1, 7, 5, 0, 0, 0, 0, (Reading(0, 0, 0),) * 65))


def test_the_longest_sweep_fits_the_longest_frame() -> None:
    longest = Sweep(1, 1, 7, 5, 0, 0, 0, 0, (Reading(-1, 0xFFFFFF, 0xFFFFFF),) * frames.MAX_READINGS)
    assert len(cobs.decode(encode(longest)[:-1])) <= MAX_FRAME_BYTES
