"""What the firmware reads from the line, against what the gateway's codec writes and reads there."""

import zlib
from dataclasses import astuple, fields
from random import Random
from typing import get_args, get_type_hints

import pytest
from cobs import cobs
from firmware.stepped_unit import stepped_unit
from hypothesis import given, settings
from hypothesis import strategies as st

from noctule_gateway.errors import FrameError
from noctule_gateway.wire.codec import FrameReader, UnknownFrameError, decode, encode
from noctule_gateway.wire.frames import (
    Ack,
    AskStatus,
    Calibrate,
    Configure,
    Enquiry,
    HostFrame,
    Install,
    Order,
    Program,
    Put,
    Rejected,
    Run,
    Start,
    Status,
    Wire,
)

LOADERS = {Put, Program, Install, Run}
REQUESTS = [kind for kind in [*get_args(Enquiry), *get_args(Order), Ack] if kind not in LOADERS]
# firmware/README.md: reasons of REJECTED
UNREADABLE, UNKNOWN_TYPE, WRONG_LENGTH, TOO_LONG = "1", "2", "3", "4"
LONGEST = 29


def integers(wire: Wire) -> st.SearchStrategy[int]:
    span = 1 << 8 * wire.size_bytes
    lowest = -span // 2 if wire.signed else 0
    return st.integers(lowest, lowest + span - 1)


def any_of(kind: type) -> st.SearchStrategy[HostFrame]:
    """Frames of this kind, with any values that its fields can hold."""
    hints = get_type_hints(kind, include_extras=True)
    wires = {field.name: get_args(hints[field.name]) for field in fields(kind)}
    values = {name: integers(wire[1]) for name, wire in wires.items() if wire}
    if kind is Start:
        values |= {"turn": integers(Wire(6)), "period": integers(Wire(4)).filter(bool)}
        return st.builds(kind, request=values["request"], pause_ms=values["pause_ms"]) | st.builds(kind, **values)
    return st.builds(kind, **values)


def spoil(piece: bytes, at: int, bits: int) -> bytes:
    place = at % len(piece)
    return piece[:place] + bytes([piece[place] ^ bits]) + piece[place + 1 :]


requests = st.sampled_from(REQUESTS).flatmap(any_of)
# Pieces between two 0x00: sound, cut, with wrong bytes, of other kinds and lengths, and noise.
sound = requests.map(lambda frame: encode(frame)[:-1])
cut = st.builds(lambda piece, at: piece[: at % len(piece)], sound, st.integers(0, 100))
spoilt = st.builds(
    lambda piece, at, bits: bytes(
        byte ^ bits if place == at % len(piece) else byte for place, byte in enumerate(piece)
    ),
    sound,
    st.integers(0, 100),
    st.integers(1, 255),
)
framed = st.binary(min_size=1, max_size=30).map(lambda body: cobs.encode(body + zlib.crc32(body).to_bytes(4, "little")))
noise = st.binary(max_size=300)
streams = st.lists(st.one_of(sound, cut, spoilt, framed, noise), max_size=8).map(
    lambda pieces: b"".join(piece + b"\0" for piece in pieces)
)


def content_of(piece: bytes) -> str:
    return cobs.decode(piece)[:-4].hex()


def expected(piece: bytes) -> set[str]:
    """What may be said of the bytes between two 0x00, by the gateway's codec."""
    if not piece:
        return {"nothing"}
    try:
        body = cobs.decode(piece)
    except cobs.DecodeError:
        return {UNREADABLE, TOO_LONG}
    if len(body) > LONGEST:
        return {TOO_LONG}
    try:
        frame = decode(piece)
    except UnknownFrameError:
        return {UNKNOWN_TYPE}
    except FrameError:
        if body[-4:] != zlib.crc32(body[:-4]).to_bytes(4, "little") or len(body) < 5:
            return {UNREADABLE}
        return {WRONG_LENGTH, UNKNOWN_TYPE}
    return {content_of(piece)} if type(frame) in REQUESTS else {UNKNOWN_TYPE}


@settings(max_examples=400)
@given(streams)
def test_every_stream_of_bytes_is_read_as_the_gateways_codec_reads_it(pure_modules, stream):
    *answers, end = pure_modules.ask("receive", stream.hex()).split()
    assert end == "."
    for answer, piece in zip(answers, stream.split(b"\0")[:-1], strict=True):
        assert answer in expected(piece)


@given(requests)
def test_every_request_that_the_gateway_can_write_is_read(pure_modules, frame):
    assert pure_modules.ask("receive", encode(frame).hex()).split() == [content_of(encode(frame)[:-1]), "."]


@given(any_of(Configure))
def test_a_plan_is_read_as_configure_writes_it_and_written_back_alike(pure_modules, frame):
    content = content_of(encode(frame)[:-1])[4:]
    *values, written = pure_modules.ask("plan_layout", content).split()
    assert [int(value) for value in values] == list(astuple(frame)[1:])
    assert written == content


@given(any_of(Calibrate))
def test_a_calibration_is_read_as_calibrate_writes_it_and_written_back_alike(pure_modules, frame):
    content = content_of(encode(frame)[:-1])[4:]
    *values, written = pure_modules.ask("calibration_layout", content).split()
    assert [int(value) for value in values] == list(astuple(frame)[1:])
    assert written == content


@pytest.mark.parametrize("seed", range(1, 4))
def test_a_unit_that_has_heard_noise_answers_and_has_counted_what_was_in_it(seed):
    random = Random(seed)
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        before = unit.ask(AskStatus(0), Status)
        heard = random.randbytes(3000)
        rejected = 0
        for at in range(0, len(heard), 60):
            unit.send_bytes(heard[at : at + 60])
            rejected += sum(isinstance(frame, Rejected) for frame in FrameReader().feed(unit.run(0.05)))
        unit.send_bytes(b"\0")
        rejected += sum(isinstance(frame, Rejected) for frame in FrameReader().feed(unit.run(0.05)))
        after = unit.ask(AskStatus(0), Status)
        pieces = [piece for piece in (heard + b"\0").split(b"\0") if piece]
        counted = after.frames_bad - before.frames_bad + after.frames_unknown - before.frames_unknown
        assert rejected == counted == len(pieces)
        assert after.bytes_lost == 0
        assert after.tick > before.tick
