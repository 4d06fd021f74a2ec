"""The firmware's CRC and COBS against Python's zlib and cobs, and against the shared vectors."""

import json
import zlib
from pathlib import Path

import pytest
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st

VECTORS = json.loads((Path(__file__).parent / "vectors" / "frames.json").read_text())

# Long runs without a zero are where COBS has its corner cases: 253, 254 and 255 bytes.
frames = st.one_of(
    st.binary(max_size=600),
    st.lists(st.integers(0, 520).map(lambda n: b"\x5a" * n), max_size=4).map(b"\0".join),
)


def test_crc_of_the_check_string_is_the_catalogue_value(pure_modules):
    # CRC-32/ISO-HDLC, check value in the CRC RevEng catalogue
    assert int(pure_modules.ask("crc", b"123456789".hex())) == 0xCBF43926


@given(st.binary(max_size=600))
def test_crc_agrees_with_zlib(pure_modules, data):
    assert int(pure_modules.ask("crc", data.hex())) == zlib.crc32(data)


@given(frames)
def test_an_encoded_frame_is_what_cobs_makes_of_it(pure_modules, frame):
    assert bytes.fromhex(pure_modules.ask("encode", frame.hex())) == cobs.encode(frame) + b"\0"


@given(frames.filter(bool), st.integers(0, 10_000))
def test_a_frame_that_goes_round_the_rings_end_is_encoded_alike(pure_modules, frame, start):
    answer = pure_modules.ask("encode_wrapped", start % len(frame), frame.hex())
    assert bytes.fromhex(answer) == cobs.encode(frame) + b"\0"


@given(frames)
def test_decoding_gives_back_what_was_encoded(pure_modules, frame):
    assert pure_modules.ask("decode", cobs.encode(frame).hex()) == f"={frame.hex()} complete"


@given(st.binary(min_size=1, max_size=300).map(lambda data: data.replace(b"\0", b"\1")))
def test_a_block_cut_short_is_noticed_when_cobs_notices_it(pure_modules, encoded):
    answer = pure_modules.ask("decode", encoded.hex())
    try:
        assert answer == f"={cobs.decode(encoded).hex()} complete"
    except cobs.DecodeError:
        assert answer.endswith("incomplete")


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: vector["name"])
def test_the_vector_has_the_crc_that_the_firmware_computes(pure_modules, vector):
    assert int(pure_modules.ask("crc", vector["content"])) == vector["crc"]


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: vector["name"])
def test_the_vector_is_encoded_and_decoded_by_the_firmware(pure_modules, vector):
    frame = vector["content"] + vector["crc"].to_bytes(4, "little").hex()
    assert pure_modules.ask("encode", frame) == vector["wire"]
    assert pure_modules.ask("decode", vector["wire"][:-2]) == f"={frame} complete"


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: vector["name"])
def test_the_vector_is_consistent_with_itself(vector):
    content = bytes.fromhex(vector["content"])
    frame = content + zlib.crc32(content).to_bytes(4, "little")
    assert bytes.fromhex(vector["wire"]) == cobs.encode(frame) + b"\0"
    assert content[0] == vector["type"]
