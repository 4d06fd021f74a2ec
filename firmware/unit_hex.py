"""Adds a unit's settings page to a firmware image, both Intel HEX: one file to flash, another for every unit."""

import argparse
import struct
import zlib
from pathlib import Path

SETTINGS_PAGE = 0xF600  # README.md, Flash
MAGIC = 0x4E43
VERSION = 2
GENERATION = 0  # the unit's own begin with 1
LARGEST_SERIAL = 0xFFFFFFFE  # 0xFFFFFFFF is an erased page's
RECORD_DATA, RECORD_END = 0, 1


def settings_page(serial: int) -> bytes:
    """The page's used bytes: magic, version, length, generation, serial and the CRC-32 of these."""
    body = struct.pack("<HI", GENERATION, serial)
    settings = struct.pack("<HBB", MAGIC, VERSION, len(body)) + body
    return settings + struct.pack("<I", zlib.crc32(settings))


def hex_record(address: int, kind: int, data: bytes = b"") -> str:
    """One line of Intel HEX; its last byte makes the sum of all bytes 0 modulo 256."""
    record = struct.pack(">BHB", len(data), address, kind) + data
    return f":{(record + bytes([-sum(record) & 0xFF])).hex().upper()}\n"


def with_settings(image: str, serial: int) -> str:
    """The image's records, those of the settings page, and the end record that the image had."""
    end = hex_record(0, RECORD_END)
    records, found, rest = image.partition(end.strip())
    if not found or rest.strip():
        raise SystemExit("the image is not Intel HEX with an end record: build it anew (make clean all)")
    return records + hex_record(SETTINGS_PAGE, RECORD_DATA, settings_page(serial)) + end


def serial_number(text: str) -> int:
    serial = int(text, 0)
    if not 0 <= serial <= LARGEST_SERIAL:
        raise argparse.ArgumentTypeError(f"{serial} is not from 0 to {LARGEST_SERIAL}")
    return serial


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("image", type=Path)
    parser.add_argument("--serial", type=serial_number, required=True)
    parser.add_argument("--output", type=Path, required=True)
    arguments = parser.parse_args()
    arguments.output.write_text(with_settings(arguments.image.read_text(), arguments.serial))


if __name__ == "__main__":
    main()
