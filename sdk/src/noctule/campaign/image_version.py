"""The version that a firmware image says it is. Whether the image is sound is for the gateway to check."""

import struct

from noctule.errors import ImageVersionError

_AT = 0x7FE0  # of an image's description: firmware/README.md, "Flash"
_DESCRIPTION = struct.Struct("<HB3B")  # magic, hardware, version; lengths and CRCs follow
_MAGIC = 0x4E49
_DATA = 0


def version_of(image: bytes, name: str) -> str:
    """The version in an Intel HEX image, ``0.9.0``; errors call the image ``name``. Raises ImageVersionError."""
    content = bytearray(_DESCRIPTION.size)
    for line in image.splitlines():
        address, data = _data_record(line)
        for place, byte in enumerate(data, start=address - _AT):
            if 0 <= place < len(content):
                content[place] = byte
    magic, _, *version = _DESCRIPTION.unpack(content)
    if magic != _MAGIC:
        raise ImageVersionError(f"{name} does not say which firmware it is: give build/update.hex")
    return ".".join(map(str, version))


def _data_record(line: bytes) -> tuple[int, bytes]:
    """Address and bytes of a data record; nothing of any other line."""
    try:
        record = bytes.fromhex(line.strip().removeprefix(b":").decode("ascii"))
        count, address, kind = struct.unpack_from(">BHB", record)
    except (ValueError, struct.error):
        return 0, b""
    return (address, record[4 : 4 + count]) if kind == _DATA else (0, b"")
