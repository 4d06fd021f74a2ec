"""Frames to bytes and back, ``COBS(type, payload, crc) 0x00``, and the reader that lives through a bad line."""

import zlib
from dataclasses import dataclass, fields
from typing import Annotated, Any, NamedTuple, cast, get_args, get_origin, get_type_hints

from cobs import cobs

from noctule_gateway.errors import FrameError
from noctule_gateway.wire.frames import (
    MAX_PUT_BYTES,
    MAX_READINGS,
    NO_LIFE,
    For,
    Frame,
    Hello,
    Order,
    Put,
    Reading,
    Start,
    Sweep,
    Sweep2,
    Wire,
)

MAX_FRAME_BYTES = 544  # before COBS
_MAX_ENCODED_BYTES = MAX_FRAME_BYTES + -(-MAX_FRAME_BYTES // 254)  # COBS adds a byte for each 254 begun
_DELIMITER = b"\x00"
_CRC_BYTES = 4


class _Field(NamedTuple):
    name: str
    wire: Wire


def _layout(frame_type: type) -> tuple[_Field, ...]:
    """The integers of a frame in the order of the wire."""
    hints = get_type_hints(frame_type, include_extras=True)
    layout = [(field.name, hints[field.name]) for field in fields(frame_type)]
    return tuple(_Field(name, get_args(hint)[1]) for name, hint in layout if get_origin(hint) is Annotated)


_TYPES: dict[int, type[Frame]] = {frame_type.TYPE: frame_type for frame_type in get_args(Frame)}
_LAYOUTS = {frame_type: _layout(frame_type) for frame_type in (*_TYPES.values(), Reading)}
_LIFE = Wire(4)  # at the end of HELLO, from protocol 3 on
_TURN, _PERIOD = Wire(6), Wire(4)  # at the end of a START that has turns
_READING_BYTES = sum(field.wire.size_bytes for field in _LAYOUTS[Reading])


def encode(frame: Frame) -> bytes:
    """The bytes of ``frame`` on the line with the 0x00 that ends it. Raises FrameError if a field is out of range."""
    body = bytes([frame.TYPE]) + _pack(frame) + _pack_tail(frame)
    return cobs.encode(body + _crc(body)) + _DELIMITER


def decode(encoded: bytes) -> Frame:
    """The frame of the bytes before a 0x00. Raises FrameError saying what does not fit."""
    try:
        body = cobs.decode(encoded)
    except cobs.DecodeError as error:
        raise FrameError(f"bad COBS: {error}") from error
    if len(body) <= _CRC_BYTES:
        raise FrameError(f"a frame of {len(body)} bytes has no type")
    content, crc = body[:-_CRC_BYTES], body[-_CRC_BYTES:]
    if crc != _crc(content):
        raise FrameError("bad CRC")
    frame_type = _TYPES.get(content[0])
    if frame_type is None:
        raise UnknownFrameError(f"unknown frame type 0x{content[0]:02x}")
    return _unpack_frame(frame_type, content[1:])


class UnknownFrameError(FrameError):
    """A sound frame of a type that is not in the table."""


def _crc(body: bytes) -> bytes:
    return zlib.crc32(body).to_bytes(_CRC_BYTES, "little")


def _pack(frame: Frame | Reading) -> bytes:
    return b"".join(_pack_integer(getattr(frame, name), wire, frame) for name, wire in _LAYOUTS[type(frame)])


def _pack_integer(value: int, wire: Wire, frame: Frame | Reading) -> bytes:
    try:
        return value.to_bytes(wire.size_bytes, "little", signed=wire.signed)
    except OverflowError as error:
        raise FrameError(f"a field does not fit its place in the frame: {frame}") from error


def _pack_tail(frame: Frame) -> bytes:
    """What has no fixed length, at a frame's end."""
    match frame:
        case Sweep(readings=readings) | Sweep2(readings=readings):
            if len(readings) > MAX_READINGS:
                raise FrameError(f"a sweep of {len(readings)} readings does not fit a frame: at most {MAX_READINGS}")
            return bytes([len(readings)]) + b"".join(map(_pack, readings))
        case Put(data=data):
            if not 1 <= len(data) <= MAX_PUT_BYTES:
                raise FrameError(f"{len(data)} bytes do not fit a PUT: from 1 to {MAX_PUT_BYTES} do")
            return data
        case For(order=order):
            return bytes([order.TYPE]) + _pack(order) + _pack_tail(order)
        case Start(turn=turn, period=period) if period:
            return _pack_integer(turn, _TURN, frame) + _pack_integer(period, _PERIOD, frame)
        case Hello(life=life) if life != NO_LIFE:
            return _pack_integer(life, _LIFE, frame)
    return b""


def _unpack(frame_type: type, payload: bytes) -> dict[str, Any]:
    values = {}
    at = 0
    for name, wire in _LAYOUTS[frame_type]:
        values[name] = int.from_bytes(payload[at : at + wire.size_bytes], "little", signed=wire.signed)
        at += wire.size_bytes
    return values


def _unpack_frame(frame_type: type[Frame], payload: bytes) -> Frame:
    size = sum(field.wire.size_bytes for field in _LAYOUTS[frame_type])
    values = _unpack(frame_type, payload)
    if frame_type in (Sweep, Sweep2):
        count = payload[size] if len(payload) > size else 0
        start = size + 1
        size = start + count * _READING_BYTES
        blocks = (payload[at : at + _READING_BYTES] for at in range(start, size, _READING_BYTES))
        values["readings"] = tuple(Reading(**_unpack(Reading, block)) for block in blocks)
    elif frame_type is Put:
        values["data"] = payload[size : size + MAX_PUT_BYTES]
        size += max(len(values["data"]), 1)
    elif frame_type is For:
        values["order"] = _unpack_order(payload[size:])
        size = len(payload)
    elif frame_type is Hello and len(payload) == size + _LIFE.size_bytes:
        values["life"] = int.from_bytes(payload[size:], "little")
        size = len(payload)
    elif frame_type is Start and len(payload) == size + _TURN.size_bytes + _PERIOD.size_bytes:
        period_at = size + _TURN.size_bytes
        values["turn"] = int.from_bytes(payload[size:period_at], "little")
        values["period"] = int.from_bytes(payload[period_at:], "little")
        size = len(payload)
    if len(payload) != size:
        raise FrameError(f"{frame_type.__name__} of {len(payload)} bytes instead of {size}")
    return frame_type(**values)


def _unpack_order(content: bytes) -> Order:
    frame_type = _TYPES.get(content[0]) if content else None
    if frame_type is None or frame_type not in get_args(Order):
        raise FrameError(f"a For holds no order but {content.hex() or 'nothing'}")
    return cast(Order, _unpack_frame(frame_type, content[1:]))


@dataclass
class FrameReader:
    """Finds frames in a stream of bytes; after garbage it goes on at the next 0x00.

    frames_bad counts what ended in a 0x00 (or grew past any frame) and could not be read, frames_unknown sound frames
    of types that are not in the table.
    """

    frames_read: int = 0
    frames_bad: int = 0
    frames_unknown: int = 0

    def __post_init__(self) -> None:
        self._buffer = bytearray()
        self._skipping = False

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that ``data`` completes."""
        found = []
        *ended, rest = data.split(_DELIMITER)
        for piece in ended:
            self._keep(piece)
            frame = self._end()
            if frame is not None:
                found.append(frame)
        self._keep(rest)
        return found

    def reset(self) -> None:
        """Forget what has come of a frame: the line is another one."""
        self._buffer.clear()
        self._skipping = False

    def _keep(self, piece: bytes) -> None:
        if self._skipping:
            return
        self._buffer += piece
        if len(self._buffer) > _MAX_ENCODED_BYTES:
            self._buffer.clear()
            self._skipping = True
            self.frames_bad += 1

    def _end(self) -> Frame | None:
        encoded = bytes(self._buffer)
        self.reset()
        if not encoded:
            return None
        try:
            frame = decode(encoded)
        except UnknownFrameError:
            self.frames_unknown += 1
        except FrameError:
            self.frames_bad += 1
        else:
            self.frames_read += 1
            return frame
        return None
