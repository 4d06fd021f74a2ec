"""Firmware images that are not the shipped one: with other contents of flash, or built from sources with a fault."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from firmware.stepped_unit import IMAGE

FIRMWARE = IMAGE.parents[1]
END_RECORD = ":00000001FF"

_MAJOR, _MINOR, _PATCH = re.findall(r"#define VERSION_\w+ (\d+)", (FIRMWARE / "src" / "version.h").read_text())
VERSION = f"{_MAJOR}.{_MINOR}.{_PATCH}"
"""The version of the firmware as it is."""

Changes = Sequence[tuple[str, str]]

# By source, what makes the firmware the one of protocol 2 again: boot and sequence alone name a sweep.
AS_PROTOCOL_2: dict[str, Changes] = {
    "src/version.h": [(f"VERSION_MINOR {_MINOR}", "VERSION_MINOR 2")],
    "src/core/protocol.h": [
        ("PROTOCOL_VERSION 3", "PROTOCOL_VERSION 2"),
        ("PROTOCOL_WITH_LIFE 3", "PROTOCOL_WITH_LIFE 255"),
        ("FRAME_ACK_2 = 0x10", "FRAME_ACK_2 = 0x12"),
        ("FRAME_ACK = 0x12", "FRAME_ACK = 0x10"),
        ("FRAME_SWEEP_2 = 0x90", "FRAME_SWEEP_2 = 0x91"),
        ("FRAME_SWEEP = 0x91", "FRAME_SWEEP = 0x90"),
        ("FRAME_FOR = 0x13", "FRAME_FOR = 0x7E"),  # which nobody sends
    ],
    "src/core/request.c": [("        return 15;", "        return 7;")],
    "src/record.h": [("RECORD_NAME_BYTES 14", "RECORD_NAME_BYTES 6")],
    "src/record.c": [
        ("OFFSET_COUNT 26", "OFFSET_COUNT 18"),
        ("HEADER_BYTES 27", "HEADER_BYTES 19"),
        ("    put32(settings_serial());\n    put32(life_number());\n", ""),
        ("if (ring_oldest_byte(0) == FRAME_SWEEP_2)", "if (ring_oldest_byte(0) != 0)"),
    ],
}


def with_flash(image: Path, contents: dict[int, bytes], place: Path) -> Path:
    """A copy of ``image`` at ``place`` that flashes these bytes too, by address."""
    records, found, _ = image.read_text().partition(END_RECORD)
    assert found, f"{image} has no end record"
    for address, data in contents.items():
        for at in range(0, len(data), 32):
            chunk = data[at : at + 32]
            record = bytes([len(chunk)]) + (address + at).to_bytes(2, "big") + b"\0" + chunk
            records += f":{(record + bytes([-sum(record) & 0xFF])).hex().upper()}\n"
    place.write_text(records + END_RECORD + "\n")
    return place


def of_unit(serial: int, place: Path, image: Path = IMAGE) -> Path:
    """``image`` at ``place`` for the unit of this serial number, as `make unit` makes it."""
    command = [FIRMWARE / "image.py", "unit", "--whole", image, "--serial", str(serial), "--output", place]
    subprocess.run([sys.executable, *command], check=True)
    return place


def built_with_fault(folder: Path, source: str, *changes: tuple[str, str]) -> Path:
    """The image of a copy of the firmware in ``folder``; in its ``source`` each first text gives way to the second."""
    return _built_with(folder, {source: changes})


def of_protocol_2(folder: Path) -> Path:
    """The image of a unit of protocol 2, version 0.2.0, built in ``folder``."""
    return _built_with(folder, AS_PROTOCOL_2)


def _built_with(folder: Path, changes: Mapping[str, Changes]) -> Path:
    copy = folder / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("simulator"))  # with what is built already
    for source, of_source in changes.items():
        text = (copy / source).read_text()
        for present, changed in of_source:
            assert text.count(present) == 1, f"{source} has {present!r} {text.count(present)} times"
            text = text.replace(present, changed)
        _write(copy / source, text, copy)
    subprocess.run(["make", "-C", copy], check=True, capture_output=True)
    return copy / "build" / IMAGE.name


def _write(path: Path, text: str, folder: Path) -> None:
    """Change a source in ``folder`` so that make compiles again what includes it; by its own rule that would be all."""
    before = path.stat()
    path.write_text(text)
    includers = [other for other in folder.rglob("*.[ch]") if f'{path.name}"' in other.read_text()]
    if path.suffix == ".h" and includers and all(other.suffix == ".c" for other in includers):
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
        for other in includers:
            other.touch()


def newer_version(folder: Path) -> Path:
    """The update to version 0.9.0, which else is the firmware as it is."""
    whole = built_with_fault(folder, "src/version.h", (f"VERSION_MINOR {_MINOR}", "VERSION_MINOR 9"))
    return whole.with_name("update.hex")
