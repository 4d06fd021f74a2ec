"""Makes the images of a unit out of what the linker gives, all of them Intel HEX: README.md, Flash.

whole    loader, application and its description, confirmed: what a programmer flashes
update   application and description, not confirmed: what an update sends
unit     a whole image with a unit's settings page, and no other
"""

import argparse
import re
import struct
import zlib
from pathlib import Path

APPLICATION = 0x1000
DESCRIPTION = 0x7FE0
CONFIRMED = DESCRIPTION + 17
IMAGE_MAGIC = 0x4E49
HARDWARE = 1

SETTINGS_PAGE, OTHER_SETTINGS_PAGE = 0xF600, 0xF800
SETTINGS_MAGIC = 0x4E43
SETTINGS_VERSION = 2
GENERATION = 0  # the unit's own begin with 1
LARGEST_SERIAL = 0xFFFFFFFE  # 0xFFFFFFFF is an erased page's

ERASED = 0xFF
RECORD_DATA, RECORD_END = 0, 1
RECORD_BYTES = 32

Memory = dict[int, int]  # address to byte


def placed(address: int, data: bytes) -> Memory:
    return dict(enumerate(data, start=address))


def with_crc(data: bytes) -> bytes:
    return data + struct.pack("<I", zlib.crc32(data))


def described(application: Memory, version: tuple[int, int, int]) -> Memory:
    """The application without gaps, and the description of it: attempts and confirmation are erased."""
    first, last = min(application), max(application)
    if first < APPLICATION or last >= DESCRIPTION:
        raise SystemExit(f"the application lies at 0x{first:04X}-0x{last:04X}: link it from 0x{APPLICATION:04X} on")
    content = bytes(application.get(address, ERASED) for address in range(APPLICATION, last + 1))
    about = struct.pack("<HB3BHI", IMAGE_MAGIC, HARDWARE, *version, len(content), zlib.crc32(content))
    return placed(APPLICATION, content) | placed(DESCRIPTION, with_crc(about))


def settings_pages(serial: int) -> Memory:
    """The page's used bytes: magic, version, length, generation, serial and the CRC-32 of these.

    The other page's magic is made not to hold: what a chip had there before, under another serial number perhaps, would
    be of a higher generation.
    """
    body = struct.pack("<HI", GENERATION, serial)
    page = with_crc(struct.pack("<HBB", SETTINGS_MAGIC, SETTINGS_VERSION, len(body)) + body)
    return placed(SETTINGS_PAGE, page) | placed(OTHER_SETTINGS_PAGE, bytes(2))


def read_hex(path: Path) -> Memory:
    memory: Memory = {}
    for number, line in enumerate(path.read_text().split(), start=1):
        record = bytes.fromhex(line.removeprefix(":"))
        length, address, kind = struct.unpack_from(">BHB", record)
        if sum(record) & 0xFF or len(record) != length + 5 or kind not in (RECORD_DATA, RECORD_END):
            raise SystemExit(f"{path}, line {number}: no record that a linker writes: build it again (make clean all)")
        if kind == RECORD_END:
            return memory
        memory |= placed(address, record[4:-1])
    raise SystemExit(f"{path}: the end record is missing: build it again (make clean all)")


def hex_record(address: int, kind: int, data: bytes = b"") -> str:
    """One line of Intel HEX; its last byte makes the sum of all bytes 0 modulo 256."""
    record = struct.pack(">BHB", len(data), address, kind) + data
    return f":{(record + bytes([-sum(record) & 0xFF])).hex().upper()}\n"


def hex_file(memory: Memory) -> str:
    """Records of at most 32 bytes, each within 32 bytes' bounds."""
    records: dict[int, bytearray] = {}
    begin = 0
    for address in sorted(memory):
        if address - 1 not in memory or address % RECORD_BYTES == 0:
            begin = address
        records.setdefault(begin, bytearray()).append(memory[address])
    data = "".join(hex_record(address, RECORD_DATA, bytes(content)) for address, content in records.items())
    return data + hex_record(0, RECORD_END)


def read_version(path: Path) -> tuple[int, int, int]:
    numbers = dict(re.findall(r"#define VERSION_(MAJOR|MINOR|PATCH) (\d+)", path.read_text()))
    return int(numbers["MAJOR"]), int(numbers["MINOR"]), int(numbers["PATCH"])


def serial_number(text: str) -> int:
    serial = int(text, 0)
    if not 0 <= serial <= LARGEST_SERIAL:
        raise argparse.ArgumentTypeError(f"{serial} is not from 0 to {LARGEST_SERIAL}")
    return serial


def make_whole(arguments: argparse.Namespace) -> Memory:
    application = described(read_hex(arguments.application), read_version(arguments.version))
    return read_hex(arguments.loader) | application | {CONFIRMED: 0}


def make_update(arguments: argparse.Namespace) -> Memory:
    return described(read_hex(arguments.application), read_version(arguments.version))


def make_unit(arguments: argparse.Namespace) -> Memory:
    return read_hex(arguments.whole) | settings_pages(arguments.serial)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    whole, update, unit = (commands.add_parser(name) for name in ("whole", "update", "unit"))
    whole.set_defaults(make=make_whole)
    whole.add_argument("--loader", type=Path, required=True)
    update.set_defaults(make=make_update)
    for command in (whole, update):
        command.add_argument("--application", type=Path, required=True)
        command.add_argument("--version", type=Path, required=True, help="version.h")
    unit.set_defaults(make=make_unit)
    unit.add_argument("--whole", type=Path, required=True)
    unit.add_argument("--serial", type=serial_number, required=True)
    for command in (whole, update, unit):
        command.add_argument("--output", type=Path, required=True)
    return parser.parse_args()


def main() -> None:
    arguments = parse()
    arguments.output.write_text(hex_file(arguments.make(arguments)))


if __name__ == "__main__":
    main()
