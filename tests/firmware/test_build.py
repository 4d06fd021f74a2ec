"""The firmware's Makefile: a clean build, nothing stale, the images, a unit's own settings page."""

import os
import shutil
import struct
import subprocess
import zlib
from pathlib import Path

import pytest
from firmware.images import with_flash
from firmware.stepped_unit import IMAGE, stepped_unit

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


def age(folder: Path) -> None:
    """Make every file ten seconds older, so that one written now is newer however coarse the file system's clock is."""
    for path in folder.rglob("*"):
        if path.is_file():
            times = path.stat()
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns - 10_000_000_000))


def content(image: Path, begin: int, end: int) -> bytes:
    """The bytes from ``begin`` to before ``end``, erased where the image has none."""
    memory = memory_of(image)
    return bytes(memory.get(address, 0xFF) for address in range(begin, end))


def test_loader_and_application_lie_in_their_own_pages(built):
    # firmware/README.md, Flash: loader 0x0000-0x0FFF, application 0x1000-0x7FFF
    assert {address >> 12 for address in memory_of(built / "build" / "loader.ihx")} == {0}
    assert all(0x1000 <= address < 0x7FE0 for address in memory_of(built / "build" / "application.ihx"))


def test_the_description_tells_version_length_and_crc(built):
    age(built)
    (built / "src" / "version.h").write_text(
        "".join(f"#define VERSION_{part} {number}\n" for part, number in [("MAJOR", 3), ("MINOR", 14), ("PATCH", 159)])
    )
    make(built, check=True)
    image = built / "build" / "update.hex"
    # firmware/README.md, Flash: magic 0x4E49, hardware 1, version, length, CRC of that many bytes, CRC of all this
    magic, hardware, *version, length, crc, own_crc = struct.unpack("<HB3BHII", content(image, 0x7FE0, 0x7FF0))
    assert (magic, hardware, version) == (0x4E49, 1, [3, 14, 159])
    application = memory_of(built / "build" / "application.ihx")
    assert 0x1000 + length == max(application) + 1
    assert crc == zlib.crc32(content(image, 0x1000, 0x1000 + length))
    assert own_crc == zlib.crc32(content(image, 0x7FE0, 0x7FEC))
    assert application.items() <= memory_of(image).items()


def test_what_is_flashed_is_the_loader_and_the_update_confirmed(built):
    whole, update = memory_of(built / "build" / "noctule.ihx"), memory_of(built / "build" / "update.hex")
    loader = memory_of(built / "build" / "loader.ihx")
    # firmware/README.md, Flash: attempts at 0x7FF0 erased, confirmed at 0x7FF1
    assert {0x7FF0, 0x7FF1}.isdisjoint(update)
    assert whole == loader | update | {0x7FF1: 0}


@pytest.mark.parametrize("limit", ["LOADER_SIZE", "CODE_SIZE"])
def test_a_part_that_outgrows_its_pages_does_not_link(built, limit):
    age(built)
    (built / "Makefile").touch()
    build = make(built, f"{limit}=0x0800")
    assert build.returncode != 0
    assert "Insufficient ROM/EPROM/FLASH memory" in build.stdout + build.stderr
    make(built, check=True)


def test_a_finished_build_has_nothing_left_to_do(built):
    assert make(built, "--question").returncode == 0


SOURCES = ["src/core/crc.c", "src/core/protocol.h", "hal/chip.h", "loader/page.c", "loader/line.h"]
CHANGED = [*SOURCES, "image.py", "Makefile"]


@pytest.mark.parametrize("changed", CHANGED)
def test_a_change_of_any_source_rebuilds_it(built, changed):
    age(built)
    (built / changed).touch()
    assert make(built, "--question").returncode == 1
    make(built, "--touch", check=True)  # nothing has changed but the time of a file


def test_a_unit_image_is_what_is_flashed_and_its_settings_page(built):
    make(built, "unit", "SERIAL=66051", check=True)
    memory = memory_of(built / "build" / "unit-66051.hex")
    # firmware/README.md, Flash: magic 0x4E43, version 2, length 6, generation 0, serial, CRC of what is before it
    settings = bytes.fromhex("434e 02 06 0000 03020100")
    page = settings + zlib.crc32(settings).to_bytes(4, "little")
    assert bytes(memory.pop(0xF600 + offset) for offset in range(len(page))) == page
    assert bytes(memory.pop(0xF800 + offset) for offset in range(2)) == b"\0\0"
    assert memory == memory_of(built / "build" / "noctule.ihx")


def test_a_unit_image_makes_a_used_chip_a_unit_of_its_own(built, tmp_path):
    make(built, "unit", "SERIAL=77", check=True)
    unit_image = built / "build" / "unit-77.hex"
    earlier = bytes.fromhex("434e 02 06 0500 21000000")  # generation 5, serial 33
    used = with_flash(IMAGE, {0xF800: earlier + zlib.crc32(earlier).to_bytes(4, "little")}, tmp_path / "used.hex")
    own = {address: bytes([byte]) for address, byte in memory_of(unit_image).items() if address >= 0xF000}
    with stepped_unit(image=with_flash(used, own, tmp_path / "flashed.hex")) as unit:
        assert unit.greet().serial == 77


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
