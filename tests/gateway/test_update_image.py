"""The image of an update as the gateway reads it."""

import re
import subprocess
from pathlib import Path

import pytest

from noctule_gateway.errors import ImageError
from noctule_gateway.update.admission import Admission
from noctule_gateway.update.image import PAGE_BYTES, PAGES

FIRMWARE = Path(__file__).parents[2] / "firmware"
END = ":00000001FF\n"


@pytest.fixture(scope="module")
def built() -> Path:
    subprocess.run(["make", "-C", FIRMWARE], check=True, capture_output=True)
    return FIRMWARE / "build"


def record(address: int, data: bytes, kind: int = 0) -> str:
    body = bytes([len(data), address >> 8, address & 0xFF, kind]) + data
    return f":{(body + bytes([-sum(body) & 0xFF])).hex()}\n"


def test_the_firmware_is_read_with_its_version_and_pages(built):
    image = Admission(takes_unsigned=True).load(built / "update.hex")
    numbers = re.findall(r"#define VERSION_\w+ (\d+)", (FIRMWARE / "src" / "version.h").read_text())
    assert image.version_text == ".".join(numbers)
    assert image.hardware == 1
    assert all(len(content) == PAGE_BYTES for content in image.pages.values())
    assert list(image.pages) == [*range(len(image.pages) - 1), PAGES - 1]
    # SDCC begins the application with its vectors, and that of the reset is a LJMP.
    assert image.pages[0][0] == 0x02


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("<html>\n", "line 1: '<html>' is no record"),
        (record(0x1000, b"\x02\x10"), "cut off: it has no end record"),
        (record(0x1000, b"\x02\x10").replace("0210", "0211") + END, "line 1: .* is damaged"),
        (record(0x1000, b"\x02\x10")[:-5] + "\n" + END, "line 1: .* is damaged"),
        (record(0x1000, b"")[1:] + END, "line 1: .* is no record"),
        ("\n" + record(0x0000, b"\x02\x10") + END, r"line 2: 0x0000 .* takes build/update\.hex"),
        (record(0x7FFF, b"\x02\x10") + END, "line 1: 0x7FFF is outside"),
        (record(0, b"\x00\x01", kind=4) + END, "type 4 is for chips with more"),
        (record(0x1000, b"\x02\x10") + END, "does not describe itself"),
        (END, "does not describe itself"),
    ],
)
def test_what_is_no_image_is_refused_by_file_and_line(tmp_path, text, complaint):
    path = tmp_path / "image.hex"
    path.write_text(text)
    with pytest.raises(ImageError, match=f"image.hex.*{complaint}"):
        Admission(takes_unsigned=True).load(path)


def test_an_image_that_was_changed_is_refused(built, tmp_path):
    path = tmp_path / "image.hex"
    path.write_text(record(0x1234, b"\xaa\x55\xaa").join(["", (built / "update.hex").read_text()]))
    Admission(takes_unsigned=True).load(path)  # what comes later in a file holds
    path.write_text((built / "update.hex").read_text().replace(END, record(0x1234, b"\xaa\x55\xaa") + END))
    with pytest.raises(ImageError, match="not what it says of itself"):
        Admission(takes_unsigned=True).load(path)


def test_the_image_for_a_programmer_is_told_from_that_of_an_update(built):
    with pytest.raises(ImageError, match=r"update takes build/update\.hex"):
        Admission(takes_unsigned=True).load(built / "noctule.ihx")


def test_a_file_that_is_not_there_or_not_text_is_named(tmp_path):
    with pytest.raises(ImageError, match=r"none\.hex can't be read"):
        Admission(takes_unsigned=True).load(tmp_path / "none.hex")
    (tmp_path / "noise.hex").write_bytes(bytes(range(256)))
    with pytest.raises(ImageError, match=r"noise\.hex is not an Intel HEX file"):
        Admission(takes_unsigned=True).load(tmp_path / "noise.hex")
