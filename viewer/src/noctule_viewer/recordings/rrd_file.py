"""The frame of Rerun's files: messages one after the other, of which a power cut leaves the last one incomplete.

A file is a head of 12 bytes, then messages, each with its kind and length as two 64-bit numbers, little-endian, in
front. The message of kind 0, if there is one, is the last: an index of the file, or zeros that a power cut has left.
This is Rerun 0.41's "RRF2".
"""

import struct
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

_MAGIC = b"RRF2"
_HEAD_BYTES = 12
_FRAME = struct.Struct("<QQ")
_END, _STORE_INFO, _CHUNK = 0, 1, 2
_START_BYTES = 4_000_000  # of a long file: what never changes comes first in it


def cut_incomplete_end(path: Path) -> int:
    """Cut an incomplete message off the end of a file: Rerun's reader refuses such a file. Returns the bytes cut off.

    Raises OSError.
    """
    size = path.stat().st_size
    with path.open("r+b") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            return 0
        last = deque(_messages(file, size), maxlen=1)
        kind, _, end = last[0] if last else (_STORE_INFO, 0, _HEAD_BYTES)
        if kind == _END or end >= size:
            return 0
        file.truncate(end)
    return size - end


def excerpt(path: Path, most_bytes: int) -> bytes:
    """A file of Rerun's, made of the first and the last chunks in ``path``, of about ``most_bytes`` of those."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
        if head[: len(_MAGIC)] != _MAGIC:
            return b""
        wanted = []
        for kind, begin, end in _messages(file, size):
            is_wanted = begin < _START_BYTES or end > size - most_bytes
            if kind == _STORE_INFO or (kind == _CHUNK and is_wanted):
                wanted.append((begin, end))
        parts = [head]
        for begin, end in wanted:
            file.seek(begin)
            parts.append(file.read(end - begin))
    return b"".join(parts)


def _messages(file: BinaryIO, size: int) -> Iterator[tuple[int, int, int]]:
    """Kind, begin and end of each complete message, up to that of kind _END."""
    begin = _HEAD_BYTES
    while begin + _FRAME.size <= size:
        file.seek(begin)
        kind, length = _FRAME.unpack(file.read(_FRAME.size))
        end = begin + _FRAME.size + length
        if end > size:
            return
        yield kind, begin, end
        if kind == _END:
            return
        begin = end
