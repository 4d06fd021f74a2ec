"""The loader of the real firmware: updates, refusals, what it does after a reset (firmware/README.md, Update)."""

import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from cobs import cobs
from firmware.images import VERSION, built_with_fault, with_flash
from firmware.stepped_unit import IMAGE, SteppedUnit, stepped_unit
from firmware.update_rig import SERIAL, staged, update

from noctule_gateway.errors import FlashError, HardwareError, UpdateError
from noctule_gateway.update.admission import Admission
from noctule_gateway.update.image import PAGES, Image
from noctule_gateway.update.outcome import Current, Updated
from noctule_gateway.wire.frames import (
    AskHello,
    AskStatus,
    Hello,
    Install,
    Loader,
    Outcome,
    Program,
    Put,
    Rejected,
    Run,
    Single,
    State,
    Status,
    Stay,
    Sweep,
)
from noctule_gateway.wire.frames import Update as EnterLoader

APPLICATION = 0x1000
CONFIRMED = 0x7FF1
LAST_PAGE = PAGES - 1
NO_VERSION = (0xFF, 0xFF, 0xFF)
ATTEMPTS = 8
SOFTWARE = 0x10  # RSTSRC
NOTE_LOADER, NOTE_NOT_GREETED = 4, 5  # firmware/README.md: HELLO's reset_note
BAD, UNKNOWN, WRONG_LENGTH, TOO_LONG = 1, 2, 3, 4  # REJECTED's reasons


@pytest.fixture(scope="module")
def hanging(tmp_path_factory) -> Image:
    """The firmware that hangs where its main loop begins."""
    folder = tmp_path_factory.mktemp("hanging")
    image = built_with_fault(
        folder, "src/main.c", ("        watchdog_feed();\n", "        while (stack_is_sound())\n            ;\n")
    )
    return Admission(takes_unsigned=True).load(image.with_name("update.hex"))


def spoiled(place: Path, *addresses: int) -> Path:
    """The firmware with a byte cleared at each address."""
    return with_flash(IMAGE, {address: b"\0" for address in addresses}, place)


def enter(unit: SteppedUnit) -> Loader:
    """The loader of a unit that was given power just now."""
    unit.greet()
    assert unit.command(EnterLoader(0, SERIAL)) == Outcome.DONE
    return unit.receive(Loader)


def versions(loader: Loader) -> tuple[int, int, int]:
    return loader.application_major, loader.application_minor, loader.application_patch


def raw(kind: int, payload: bytes) -> bytes:
    body = bytes([kind]) + payload
    return cobs.encode(body + zlib.crc32(body).to_bytes(4, "little")) + b"\0"


def test_a_unit_starts_in_less_than_half_a_second():
    # 0.4 s of it are the CRC of the application at 12 MHz.
    with stepped_unit() as unit:
        unit.receive(Hello, 0.5)


def test_an_update_ends_with_the_new_application_confirmed(new_image):
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        assert update(unit, new_image) == Updated(VERSION)
        assert unit.ask(AskHello(0), Hello).version == "0.9.0"
        for _ in range(ATTEMPTS + 1):
            unit.inject("power_cut", for_s=0.2)
            assert unit.receive_either(Hello, Loader, 2.0).request == 0
            assert unit.ask(AskHello(0), Hello).version == "0.9.0"


def test_the_application_of_an_update_says_that_the_loader_started_it(new_image):
    with stepped_unit("--laps", "0") as unit:
        before = unit.greet()
        update(unit, new_image)
        after = unit.ask(AskHello(0), Hello)
        assert (after.reset_cause, after.reset_note) == (SOFTWARE, NOTE_LOADER)
        assert after.boot == before.boot + 1


def test_a_unit_that_has_the_version_is_left_alone_unless_it_is_to_be_updated_again():
    image = Admission(takes_unsigned=True).load(IMAGE.with_name("update.hex"))
    with stepped_unit("--laps", "0") as unit:
        boot = unit.greet().boot
        assert update(unit, image) == Current()
        assert unit.ask(AskHello(0), Hello).boot == boot
        assert update(unit, image, again=True) == Updated(VERSION)
        assert unit.ask(AskHello(0), Hello).boot == boot + 1


def test_sweeps_that_wait_in_the_ring_outlive_an_update(new_image):
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        assert unit.command(Single(0)) == Outcome.DONE
        sweep = unit.receive(Sweep, 60.0)
        assert update(unit, new_image) == Updated(VERSION)
        assert unit.receive(Sweep) == sweep
        unit.acknowledge(sweep)
        assert unit.ask(AskStatus(0), Status).sweeps_waiting == 0


def test_a_unit_that_sweeps_is_stopped_for_its_update(new_image):
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        assert unit.command(Single(0)) == Outcome.DONE
        unit.wait_for_state(State.SWEEPING)
        assert update(unit, new_image) == Updated(VERSION)


# ---- Refusals ----------------------------------------------------------------------------------------


def test_update_is_refused_for_another_unit_and_in_the_midst_of_a_sweep():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        assert unit.command(EnterLoader(0, SERIAL + 1)) == Outcome.NOT_FOR_THIS_UNIT
        assert unit.command(Single(0)) == Outcome.DONE
        unit.wait_for_state(State.SWEEPING)
        assert unit.command(EnterLoader(0, SERIAL)) == Outcome.BUSY


def test_the_loader_says_who_it_is_and_why_it_stays():
    with stepped_unit("--laps", "0") as unit:
        loader = enter(unit)
        assert loader == Loader(0, 3, SERIAL, 1, 2, Stay.ASKED, *map(int, VERSION.split(".")))
        assert unit.ask(AskHello(0), Loader) == replace(loader, request=2 + 1)


@pytest.mark.parametrize("place", [0xF600, 0xF800])
def test_the_serial_number_is_found_in_either_settings_page(tmp_path, place):
    # firmware/README.md, Flash: magic 0x4E43, version 2, length 6, generation, serial, CRC of what is before it
    body = struct.pack("<HBBHI", 0x4E43, 2, 6, 3, SERIAL)
    page = body + zlib.crc32(body).to_bytes(4, "little")
    other = {0xF600: 0xF800, 0xF800: 0xF600}[place]
    image = with_flash(IMAGE, {place: page, other: b"\0", APPLICATION + 100: b"\0"}, tmp_path / "image.hex")
    with stepped_unit("--laps", "0", image=image) as unit:
        assert unit.receive(Loader).serial == SERIAL


def test_what_does_not_fit_a_page_or_staging_is_out_of_range():
    with stepped_unit("--laps", "0") as unit:
        enter(unit)
        assert unit.command(Put(0, 511, b"\x01")) == Outcome.DONE
        assert unit.command(Put(0, 511, b"\x01\x02")) == Outcome.OUT_OF_RANGE
        assert unit.command(Put(0, 384, bytes(128))) == Outcome.DONE
        assert unit.command(Put(0, 385, bytes(128))) == Outcome.OUT_OF_RANGE
        assert unit.command(Put(0, 0xFFFF, b"\x01")) == Outcome.OUT_OF_RANGE
        assert unit.command(Program(0, PAGES, 0)) == Outcome.OUT_OF_RANGE


def test_a_page_is_programmed_only_if_it_has_the_crc_named():
    with stepped_unit("--laps", "0") as unit:
        enter(unit)
        content = bytes(range(256)) * 2
        for at in range(0, 512, 128):
            assert unit.command(Put(0, at, content[at : at + 128])) == Outcome.DONE
        operations = unit.truth["flash_operations"]
        assert unit.command(Program(0, 3, zlib.crc32(content) ^ 1)) == Outcome.BAD_CRC
        assert unit.truth["flash_operations"] == operations
        assert unit.command(Program(0, 3, zlib.crc32(content))) == Outcome.DONE
        # the page erased, and each byte written but the two that are 0xFF
        assert unit.truth["flash_operations"] == operations + 1 + 510


def test_a_frame_that_comes_again_is_answered_alike_and_wears_no_flash():
    with stepped_unit("--laps", "0") as unit:
        enter(unit)
        erased = zlib.crc32(b"\xff" * 512)
        content = b"\xaa" * 512
        for at in range(0, 512, 128):
            for _ in range(2):
                assert unit.command(Put(0, at, content[at : at + 128])) == Outcome.DONE
        assert unit.command(Program(0, 3, zlib.crc32(content))) == Outcome.DONE
        operations = unit.truth["flash_operations"]
        assert unit.command(Program(0, 3, zlib.crc32(content))) == Outcome.DONE
        assert unit.command(Program(0, 4, erased)) == Outcome.DONE
        assert unit.truth["flash_operations"] == operations


def test_nothing_is_installed_that_does_not_describe_itself_soundly(tmp_path, new_image):
    for name, spoil in {"nothing": {}, "magic": {0xEFE0: b"\0"}, "content": {0x8123: b"\0\0\0\0"}}.items():
        contents = staged(new_image) if spoil else {}
        image = with_flash(IMAGE, contents | spoil, tmp_path / f"{name}.hex")
        with stepped_unit("--laps", "0", image=image) as unit:
            enter(unit)
            operations = unit.truth["flash_operations"]
            assert unit.command(Install(0)) == Outcome.BAD_CRC, name
            assert unit.truth["flash_operations"] == operations
            assert unit.command(Run(0)) == Outcome.DONE
            assert unit.receive(Hello).version == VERSION


def test_an_image_for_other_hardware_is_refused_by_host_and_loader(tmp_path, new_image):
    page = bytearray(new_image.pages[LAST_PAGE])
    page[-30] = 2  # the hardware
    page[-20:-16] = zlib.crc32(page[-32:-20]).to_bytes(4, "little")
    other = replace(new_image, hardware=2, pages=new_image.pages | {LAST_PAGE: bytes(page)})
    with stepped_unit("--laps", "0", image=with_flash(IMAGE, staged(other), tmp_path / "other.hex")) as unit:
        enter(unit)
        assert unit.command(Install(0)) == Outcome.NOT_FOR_THIS_UNIT
        assert isinstance(update(unit, other), HardwareError)
        assert unit.command(Run(0)) == Outcome.DONE
        assert unit.receive(Hello).version == VERSION


def test_what_the_loader_cannot_obey_is_rejected_with_its_reason():
    with stepped_unit("--laps", "0") as unit:
        enter(unit)
        for data, reason, kind in [
            (raw(0x02, b"\x01"), UNKNOWN, 0x02),
            (raw(0x23, b"\x01\x02"), WRONG_LENGTH, 0x23),
            (raw(0x20, b"\x01\x00\x00"), WRONG_LENGTH, 0x20),
            (raw(0x20, b"\x01\x00\x00" + b"\x55" * 129), TOO_LONG, 0x20),
            (raw(0x01, b"\x01\x02")[:-2] + b"\x77\0", BAD, 0),
            (b"\x09\x02\x01\0", BAD, 0),
            (b"\x05" * 700 + b"\0", TOO_LONG, 0x05),
        ]:
            unit.send_bytes(data)
            assert unit.receive(Rejected, 1.0) == Rejected(reason, kind)


# ---- Staying and leaving -----------------------------------------------------------------------------


def test_the_loader_speaks_up_each_second_and_starts_the_application_after_a_minute():
    with stepped_unit("--laps", "0") as unit:
        enter(unit)
        begun_s = unit.now_s
        heard = 0
        while isinstance(unit.receive_either(Loader, Hello), Loader):
            heard += 1
        assert unit.now_s - begun_s == pytest.approx(60, abs=2)
        assert heard == pytest.approx(60, abs=2)
        assert unit.ask(AskHello(0), Hello).version == VERSION


def test_a_gateway_that_says_hello_does_not_keep_a_unit_in_its_loader():
    with stepped_unit("--laps", "0") as unit:
        enter(unit)
        begun_s = unit.now_s
        while unit.now_s < begun_s + 55:
            assert unit.ask(AskHello(0), Loader).reason == Stay.ASKED
            unit.run(1.3)
        unit.receive(Hello, 8.0)


def test_an_update_that_pauses_does_not_lose_its_loader():
    with stepped_unit("--laps", "0") as unit:
        enter(unit)
        for _ in range(2):
            unit.run(40.0)
            assert unit.command(Put(0, 0, b"\x01")) == Outcome.DONE


def test_a_damaged_application_is_made_good_from_staging(tmp_path, new_image):
    image = with_flash(IMAGE, staged(new_image) | {0x2345: b"\0\0\0\0"}, tmp_path / "staged.hex")
    with stepped_unit("--laps", "0", image=image) as unit:
        assert unit.receive(Hello, 5.0).version == "0.9.0"


@pytest.mark.parametrize("address", [APPLICATION, 0x4321, 0x7FE0, 0x7FEF])
def test_without_a_sound_application_the_loader_waits_for_one_and_takes_it(tmp_path, new_image, address):
    with stepped_unit(
        "--laps", "0", image=spoiled(tmp_path / "spoiled.hex", address, address - 16 * (address < 0x7FE0))
    ) as unit:
        loader = unit.receive(Loader)
        assert (loader.reason, versions(loader)) == (Stay.NO_APPLICATION, NO_VERSION)
        assert unit.command(Run(0)) == Outcome.BAD_CRC
        assert update(unit, new_image) == Updated(None)


def test_an_image_that_hangs_uses_up_its_attempts_and_a_good_one_brings_the_unit_back(hanging, new_image):
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        resets = unit.truth["resets"]
        error = update(unit, hanging, again=True)
        assert isinstance(error, UpdateError) and "has not reported in" in str(error)
        # One reset into the loader, one out of it, and one by the watchdog for each attempt.
        assert unit.truth["resets"] - resets == 1 + 1 + ATTEMPTS
        for _ in range(2):
            unit.inject("power_cut", for_s=0.2)
            assert unit.receive_either(Loader, Hello).request == 0
            assert unit.ask(AskHello(0), Loader).reason == Stay.NOT_CONFIRMED
        assert unit.command(Run(0)) == Outcome.OUT_OF_RANGE
        assert update(unit, new_image) == Updated(VERSION)


def test_an_image_that_runs_but_hears_no_host_ends_in_the_loader_too(tmp_path):
    image = with_flash(IMAGE, {CONFIRMED: b"\xff"}, tmp_path / "unconfirmed.hex")
    with stepped_unit("--laps", "0", image=image) as unit:
        starts = [unit.receive(Hello, 310.0).reset_note for _ in range(ATTEMPTS)]
        assert starts == [0] + [NOTE_NOT_GREETED] * (ATTEMPTS - 1)
        assert unit.receive(Loader, 310.0).reason == Stay.NOT_CONFIRMED


def test_an_image_that_was_greeted_once_runs_on(tmp_path):
    image = with_flash(IMAGE, {CONFIRMED: b"\xff"}, tmp_path / "unconfirmed.hex")
    with stepped_unit("--laps", "0", image=image) as unit:
        unit.greet()
        resets = unit.truth["resets"]
        unit.run(310.0)
        assert unit.truth["resets"] == resets


def test_an_unconfirmed_image_may_be_installed_again_and_gets_new_attempts(hanging):
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        update(unit, hanging, again=True)
        resets = unit.truth["resets"]
        assert unit.command(Install(0), 10.0) == Outcome.DONE
        assert unit.command(Run(0)) == Outcome.DONE
        assert unit.receive(Loader).reason == Stay.NOT_CONFIRMED
        assert unit.truth["resets"] - resets == 1 + ATTEMPTS


def test_after_an_install_the_loader_no_longer_says_that_an_earlier_image_was_not_confirmed(tmp_path, new_image):
    # A host that loses the line here would take the new image for the one that does not start.
    used_up = {CONFIRMED: b"\xff", CONFIRMED - 1: b"\0"}
    image = with_flash(IMAGE, used_up | staged(new_image), tmp_path / "used up.hex")
    with stepped_unit("--laps", "0", image=image) as unit:
        assert unit.receive(Loader).reason == Stay.NOT_CONFIRMED
        assert unit.command(Install(0), 10.0) == Outcome.DONE
        assert unit.ask(AskHello(0), Loader).reason == Stay.ASKED


# The loader with a byte that its copy does not get written, as where flash is worn.
WORN = ("if (page_image[i] != ERASED)", "if (page_image[i] != ERASED && address + i != 0x{address:04X})")


@pytest.fixture(scope="module")
def with_worn_byte(tmp_path_factory) -> Callable[[int], Path]:
    def build(address: int) -> Path:
        change = (WORN[0], WORN[1].format(address=address))
        return built_with_fault(tmp_path_factory.mktemp("worn"), "loader/page.c", change)

    return build


def test_flash_that_does_not_hold_a_page_of_staging_is_told(with_worn_byte, new_image):
    with stepped_unit("--laps", "0", image=with_worn_byte(0x8123)) as unit:
        unit.greet()
        error = update(unit, new_image)
        assert isinstance(error, FlashError) and "page 0 of the unit's staging" in str(error)
        assert unit.command(Run(0)) == Outcome.DONE
        assert unit.receive(Hello).version == VERSION


def test_flash_that_does_not_hold_the_copy_is_told_and_not_copied_to_for_ever(with_worn_byte, new_image, tmp_path):
    contents = staged(new_image)
    worn = with_flash(with_worn_byte(0x1123), contents | {0x1122: b"\0", 0x1124: b"\0"}, tmp_path / "worn.hex")
    with stepped_unit("--laps", "0", image=worn) as unit:
        assert unit.receive(Loader).reason == Stay.FLASH_FAILED
        operations = unit.truth["flash_operations"]
        unit.run(62.0)
        assert unit.ask(AskHello(0), Loader).reason == Stay.FLASH_FAILED
        assert unit.truth["flash_operations"] == operations
        assert isinstance(update(unit, new_image), FlashError)


# ---- Bad lines ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("seed", "spoiled_bytes"), [(1, 0.002), (2, 0.002), (3, 0.01)])
def test_an_update_gets_through_a_line_that_spoils_bytes(new_image, seed, spoiled_bytes):
    with stepped_unit("--laps", "0", "--seed", str(seed)) as unit:
        unit.greet()
        unit.inject("cable_corrupts", to_unit=spoiled_bytes, to_host=spoiled_bytes)
        assert update(unit, new_image) == Updated(VERSION)


@pytest.mark.soak
def test_an_update_gets_through_a_line_that_spoils_one_byte_in_twenty(new_image):
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        unit.inject("cable_corrupts", to_unit=0.05, to_host=0.05)
        assert update(unit, new_image) == Updated(VERSION)
