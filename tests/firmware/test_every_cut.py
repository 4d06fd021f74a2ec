"""Power cuts at flash operations of a boot, of STORE and of an update, and at those of the recovery.

At every operation of a boot, of STORE and of a small install, with a second cut at every operation of the recovery.
Without a second cut at every operation of staging, and at each 97th of a full-size install; the soak tests cut a
full-size update at every operation. The firmware's own code on a flash that fails, under gcc: native_flash.c says how.
test_loader_power.py cuts the power of the very image that is flashed, in the simulator, at fewer places.
"""

import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "firmware"
SOURCES = [
    *("loader/application.c", "loader/image.c", "loader/install.c", "loader/page.c"),
    *("src/boot_number.c", "src/life.c", "src/settings.c"),
    *(f"src/core/{name}.c" for name in ("calibration", "crc", "little_endian", "plan", "wire_layout")),
]
# SDCC's words, of which gcc knows none; the loader's jump into the application is nothing here.
WORDS = ["__xdata=", "__code=", "__at(address)=", "__interrupt(number)=", "__asm__(text)="]


def built(place: Path, source: str = "", change: tuple[str, str] = ("", "")) -> Path:
    """The program at ``place``; in ``source`` the first text gives way to the second."""
    sources = [HERE / "native_flash.c", HERE / "failing_flash.c", *(FIRMWARE / name for name in SOURCES)]
    folders: Sequence[Path] = [FIRMWARE / Path(source).parent] if source else []
    if source:
        text = (FIRMWARE / source).read_text()
        assert text.count(change[0]) == 1
        for header in ("../hal/", "../src/"):
            text = text.replace(f'"{header}', f'"{FIRMWARE}/{header[3:]}')
        changed = place.with_suffix(".c")
        changed.write_text(text.replace(*change))
        sources = [changed if path == FIRMWARE / source else path for path in sources]
    program = place.with_suffix("")
    flags = ["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Wno-sign-compare", "-Werror", *(f"-D{word}" for word in WORDS)]
    subprocess.run(["gcc", *flags, *(f"-I{folder}" for folder in folders), *sources, "-o", program], check=True)
    return program


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(tmp_path_factory.mktemp("cuts") / "native_flash")


def run(program: Path, piece: str, image_bytes: int, step: int, stride: int) -> subprocess.CompletedProcess[str]:
    command = [program, piece, str(image_bytes), str(step), str(stride)]
    return subprocess.run(command, capture_output=True, text=True)


# Length of the image, a cut at every step-th operation, a second at every stride-th of its recovery; how many states
# that makes. An image of 100 bytes has every kind of operation that one of 28,000 has: pages are erased, bytes are
# written.
EVERY_CUT = [
    ("boot", 0, 1, 1, 2_436),
    ("store", 0, 1, 1, 41_418),
    ("stage", 600, 1, 0, 3_069),
    ("install", 100, 1, 1, 107_541),
    ("install", 700, 1, 0, 2_148),
    ("install", 28_000, 97, 0, 867),
]
BY_THE_HUNDRED_THOUSAND = [
    ("install", 700, 1, 7, 527_349),
    ("stage", 28_000, 1, 0, 84_360),
    ("install", 28_000, 1, 0, 83_862),
]


def check(program: Path, piece: str, image_bytes: int, step: int, stride: int, states: int) -> None:
    found = run(program, piece, image_bytes, step, stride)
    assert found.returncode == 0, found.stdout
    print(f"{piece}, an image of {image_bytes} bytes: {found.stdout.strip()} states, all sound")
    assert int(found.stdout) == states


@pytest.mark.parametrize(("piece", "image_bytes", "step", "stride", "states"), EVERY_CUT)
def test_no_cut_leaves_a_dead_unit_or_a_mixture(program, piece, image_bytes, step, stride, states):
    check(program, piece, image_bytes, step, stride, states)


def test_the_readme_says_how_many_states_are_tried() -> None:
    text = " ".join((FIRMWARE / "README.md").read_text().split())
    assert f" {sum(states for *_, states in EVERY_CUT):,} states" in text
    full_size = sum(states for _, image_bytes, *_, states in BY_THE_HUNDRED_THOUSAND if image_bytes == 28_000)
    assert f" the {full_size:,} of the soak tests" in text


@pytest.mark.soak
@pytest.mark.parametrize(("piece", "image_bytes", "step", "stride", "states"), BY_THE_HUNDRED_THOUSAND)
def test_no_cut_or_pair_of_cuts_leaves_a_dead_unit(program, piece, image_bytes, step, stride, states):
    check(program, piece, image_bytes, step, stride, states)


MISTAKES = [
    ("install", "loader/page.c", ("    if (holds_image(address))", "    if (flash_read(address) == page_image[0])")),
    (
        "store",
        "src/settings.c",
        (
            "? SETTINGS_SECOND_PAGE : SETTINGS_FIRST_PAGE;\n    uint16_t",
            "? SETTINGS_FIRST_PAGE : SETTINGS_FIRST_PAGE;\n    uint16_t",
        ),
    ),
    ("boot", "src/boot_number.c", ("page == FIRST_PAGE ? SECOND_PAGE : FIRST_PAGE, base_of", "page, base_of")),
    ("boot", "src/life.c", ("    flash_erase(PAGE);\n    write32(PAGE, life);", "    write32(PAGE, life);")),
]


@pytest.mark.parametrize(("piece", "source", "change"), MISTAKES)
def test_a_mistake_in_the_order_of_operations_is_found(tmp_path, piece, source, change):
    found = run(built(tmp_path / Path(source).name, source, change), piece, 100, 1, 1)
    assert found.returncode == 1 and "after cuts at operations" in found.stdout
