"""The image that an update sends, read from Intel HEX and checked by its description: firmware/README.md, "Flash".

The reader is strict and knows what fits a chip of 64 KB, data and end records; a package for all of Intel HEX would
take what no unit can have, and could not say which line is wrong.
"""

import struct
import zlib
from dataclasses import dataclass

from noctule_gateway.errors import ImageError

PAGE_BYTES = 512
PAGES = 56

_APPLICATION = 0x1000
_END = _APPLICATION + PAGES * PAGE_BYTES
_DESCRIPTION = _END - 32 - _APPLICATION
_CHECKED_BYTES = 16  # of the description, its own CRC included
_MAGIC = 0x4E49
_ERASED = 0xFF
_RECORD_DATA, _RECORD_END = 0, 1


@dataclass(frozen=True)
class Image:
    """An application for units of ``hardware``: the pages of staging that hold it, by their number.

    ``signer`` says in words who has signed it, as ``admission`` found.
    """

    version: tuple[int, int, int]
    hardware: int
    pages: dict[int, bytes]
    signer: str = "signature not checked"

    @property
    def version_text(self) -> str:
        """The version as people write it."""
        return ".".join(map(str, self.version))


def parse(data: bytes, name: str) -> Image:
    """The image of an update from the bytes of its file, which errors call ``name``; signatures are passed over.

    Raises ImageError, which says what is wrong, in which line, and what to do.
    """
    try:
        text = data.decode("ascii")
    except UnicodeDecodeError as error:
        raise ImageError(f"{name} is not an Intel HEX file: {error}") from error
    return _described(name, _read(name, text))


def _read(name: str, text: str) -> bytes:
    """All pages of the application; what the file leaves out is erased."""
    content = bytearray([_ERASED]) * (_END - _APPLICATION)
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            continue
        kind, address, data = _record(f"{name}, line {number}", line.strip())
        if kind == _RECORD_END:
            return bytes(content)
        if not _APPLICATION <= address <= _END - len(data):
            raise ImageError(
                f"{name}, line {number}: 0x{address:04X} is outside the application's pages: "
                "an update takes build/update.hex, the other images are for a programmer"
            )
        content[address - _APPLICATION : address - _APPLICATION + len(data)] = data
    raise ImageError(f"{name} is cut off: it has no end record")


def _record(where: str, line: str) -> tuple[int, int, bytes]:
    try:
        record = bytes.fromhex(line.removeprefix(":"))
        count, address, kind = struct.unpack_from(">BHB", record)
    except (ValueError, struct.error) as error:
        raise ImageError(f"{where}: {line[:40]!r} is no record of Intel HEX, or is cut") from error
    if not line.startswith(":") or len(record) != count + 5 or sum(record) & 0xFF:
        raise ImageError(f"{where}: {line[:40]!r} is no record of Intel HEX, or is damaged")
    if kind not in (_RECORD_DATA, _RECORD_END):
        raise ImageError(f"{where}: a record of type {kind} is for chips with more than 64 KB")
    return kind, address, record[4:-1]


def _described(name: str, content: bytes) -> Image:
    description = content[_DESCRIPTION : _DESCRIPTION + _CHECKED_BYTES]
    magic, hardware, *version, length, crc, own_crc = struct.unpack("<HB3BHII", description)
    if magic != _MAGIC or own_crc != zlib.crc32(description[:-4]):
        raise ImageError(f"{name} does not describe itself: build it by make -C firmware and take build/update.hex")
    if length > _DESCRIPTION or crc != zlib.crc32(content[:length]):
        raise ImageError(f"{name} is not what it says of itself: build it again (make -C firmware)")
    numbers = [*range(-(-length // PAGE_BYTES)), PAGES - 1]
    pages = {page: content[page * PAGE_BYTES : (page + 1) * PAGE_BYTES] for page in numbers}
    return Image((version[0], version[1], version[2]), hardware, pages)
