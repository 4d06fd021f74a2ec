"""The firmware's Makefile: a clean build, nothing stale, and a unit's own settings page."""

import shutil
import struct
import subprocess
import zlib
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).parents[2] / "firmware"


def make(folder: Path, *arguments: str, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["make", "-C", folder, *arguments], capture_output=True, text=True, **options)


def memory_of(image: Path) -> dict[int, int]:
    """Address to byte of an Intel HEX file, its checksums checked."""
    memory = {}
    for line in image.read_text().split():
        record = bytes.fromhex(line[1:])
        assert sum(record) & 0xFF == 0
        length, address, kind = struct.unpack(">BHB", record[:4])
        if kind == 0:
            memory |= dict(enumerate(record[4 : 4 + length], start=address))
    return memory


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    """A copy of the firmware, built."""
    copy = tmp_path_factory.mktemp("build") / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build", "simulator"))
    make(copy, check=True)
    return copy


def test_the_application_lies_below_the_staging_area(built):
    # firmware/README.md, Flash: application 0x0000-0x7FFF
    memory = memory_of(built / "build" / "noctule.ihx")
    assert min(memory) == 0 and max(memory) < 0x8000


def test_a_finished_build_has_nothing_left_to_do(built):
    assert make(built, "--question").returncode == 0


@pytest.mark.parametrize("changed", ["src/crc.c", "src/protocol.h", "hal/chip.h", "Makefile"])
def test_a_change_of_any_source_builds_anew(built, changed):
    (built / changed).touch()
    assert make(built, "--question").returncode == 1
    make(built, check=True)


def test_a_unit_image_is_the_application_and_its_settings_page(built):
    make(built, "unit", "SERIAL=66051", check=True)
    memory = memory_of(built / "build" / "unit-66051.hex")
    # firmware/README.md, Flash: magic 0x4E43, version 2, length 6, generation 0, serial, CRC of what is before it
    settings = bytes.fromhex("434e 02 06 0000 03020100")
    page = settings + zlib.crc32(settings).to_bytes(4, "little")
    assert bytes(memory.pop(0xF600 + offset) for offset in range(len(page))) == page
    assert memory == memory_of(built / "build" / "noctule.ihx")


@pytest.mark.parametrize("serial", ["-1", "0xFFFFFFFF", "seven"])
def test_a_serial_number_that_a_unit_cannot_have_is_refused(built, serial):
    build = make(built, "unit", f"SERIAL={serial}")
    assert build.returncode != 0
    assert "serial" in build.stderr


def test_a_missing_compiler_is_named_in_one_line(tmp_path):
    copy = tmp_path / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build", "simulator"))
    build = make(copy, "SDCC=no-such-compiler")
    assert build.returncode != 0
    assert "sdcc is missing: apt-get install sdcc" in build.stderr
