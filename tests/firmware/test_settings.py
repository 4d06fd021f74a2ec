"""What a unit keeps over power-ups: serial number, plan, calibration and trim, wherever the power fails."""

import struct
import zlib
from dataclasses import replace
from itertools import count

import pytest
from firmware.images import built_with_fault, with_flash
from firmware.stepped_unit import IMAGE, SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import (
    NO_SERIAL,
    AskSettings,
    AskStatus,
    Calibrate,
    Configure,
    Hello,
    HomeKind,
    Outcome,
    Reset,
    Result,
    Settings,
    SetWaypoint,
    Single,
    State,
    Status,
    Store,
)

# firmware/README.md, Flash
FIRST_PAGE, SECOND_PAGE = 0xF600, 0xF800
MAGIC, VERSION = 0x4E43, 2
# header, generation, serial, plan, calibration, trim and CRC
PAGE_BYTES = 4 + 2 + 4 + 14 + 8 + 2 + 4
NO_TRIM = 0x7FFF

DEFAULT = Settings(0, 1, -24576, 4096, 13, 60, 600, 100, 20, 1, round(25792 / 405 * 64 * 256), 0, 0, -27307, NO_TRIM)
PLAN = Configure(0, -9000, 500, 37, 40, 700, 90, 10, 3)
PLAN_FIELDS = {name: value for name, value in vars(PLAN).items() if name != "request"}
CALIBRATION = Calibrate(0, 4090 * 256, 7, HomeKind.STOP, -29000)
AFTER_BOTH = Settings(0, 0, -9000, 500, 37, 40, 700, 90, 10, 3, 4090 * 256, 7, 1, -29000, NO_TRIM)


def settings(unit: SteppedUnit) -> Settings:
    return replace(unit.ask(AskSettings(0), Settings), request=0)


def page(body: bytes) -> bytes:
    content = struct.pack("<HBB", MAGIC, VERSION, len(body)) + body
    return content + struct.pack("<I", zlib.crc32(content))


def power_cycle(unit: SteppedUnit) -> Hello:
    unit.inject("power_cut", for_s=0.5)
    return unit.receive(Hello)


def test_a_unit_begins_with_the_default_settings():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        assert settings(unit) == DEFAULT


def test_what_is_not_stored_is_gone_after_a_power_up():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        assert unit.command(PLAN) == unit.command(CALIBRATION) == Outcome.DONE
        assert settings(unit) == AFTER_BOTH
        power_cycle(unit)
        assert settings(unit) == DEFAULT


def test_what_is_stored_outlives_a_power_up_again_and_again():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        for first_bearing in range(-9000, -8990):
            wanted = replace(PLAN, first_bearing=first_bearing)
            assert unit.command(wanted) == unit.command(CALIBRATION) == unit.command(Store(0)) == Outcome.DONE
            expected = replace(AFTER_BOTH, first_bearing=first_bearing, stored=1)
            assert settings(unit) == expected
            assert power_cycle(unit).serial == 1
            assert settings(unit) == expected


@pytest.mark.parametrize("seed", range(1, 6))
def test_a_power_cut_at_any_flash_operation_of_a_store_leaves_the_old_or_the_new_settings(seed):
    with stepped_unit("--laps", "0", "--seed", str(seed)) as unit:
        unit.greet()
        held = DEFAULT
        for operation in count(1):
            assert unit.command(replace(PLAN, first_bearing=-9000 + operation)) == Outcome.DONE
            wanted = replace(settings(unit), stored=1)
            unit.inject("power_cut_at_flash_operation", number=operation)
            unit.send(Store(200))
            after = unit.receive_either(Result, Hello)
            if isinstance(after, Result):
                break
            assert after.serial == 1
            found = settings(unit)
            assert found in (held, wanted)
            held = found
        # Every operation was cut: the erasing of a page, and the writing of each of its bytes.
        assert operation == 1 + PAGE_BYTES + 1
        assert settings(unit) == wanted


def test_a_dip_of_the_supply_at_any_moment_of_a_store_leaves_the_old_or_the_new_settings():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        found = {"old": 0, "new": 0}
        held = DEFAULT
        # From before the request is read to after its answer.
        for tenths_of_ms in range(5, 300, 5):
            assert unit.command(replace(PLAN, first_bearing=-9000 + tenths_of_ms)) == Outcome.DONE
            wanted = replace(settings(unit), stored=1)
            unit.send(Store(200))
            unit.run(tenths_of_ms * 1e-4)
            unit.inject("brown_out")
            assert unit.receive(Hello).serial == 1
            now = settings(unit)
            assert now in (held, wanted)
            found["new" if now == wanted else "old"] += 1
            held = now
        assert min(found.values()) >= 5
        # The page that did not hold may be in any state: storing goes on.
        assert unit.command(PLAN) == unit.command(Store(0)) == Outcome.DONE
        assert settings(unit).stored == 1


@pytest.mark.parametrize("seed", range(1, 5))
def test_the_clock_goes_on_over_a_store_however_long_flash_takes(seed):
    with stepped_unit("--laps", "0", "--seed", str(seed)) as unit:
        unit.greet()

        def offset_s() -> float:
            status = unit.ask(AskStatus(0), Status)
            return unit.now_s - status.tick * 0.25e-6

        before_s = offset_s()
        # At odds with the 16.384 ms in which the 16-bit count wraps: STORE comes all over it. An erase takes any time
        # from 10 to 20 ms. Begun at any moment it would hide a wrap one time in 25.
        for _ in range(50):
            unit.run(0.0511)
            assert unit.command(Store(0)) == Outcome.DONE
        # A wrap that was missed would be 16.384 ms, a round of the tasks is 2 ms.
        assert offset_s() == pytest.approx(before_s, abs=0.003)


def test_the_watchdog_is_on_again_after_a_store(tmp_path):
    hangs = "        watchdog_feed();\n        if (unit_waypoint() == 666)\n            for (;;)\n                ;\n"
    image = built_with_fault(tmp_path, "src/main.c", ("        watchdog_feed();\n", hangs))
    with stepped_unit("--laps", "0", image=image) as unit:
        unit.greet()
        assert unit.command(Store(0)) == Outcome.DONE
        unit.send(SetWaypoint(9, 666))
        assert unit.receive(Hello).reset_cause == 0x08


def test_nothing_is_stored_while_the_motor_turns():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        assert unit.command(Single(0)) == Outcome.DONE
        assert unit.command(Store(0)) == Outcome.BUSY
        unit.wait_for_state(State.IDLE)
        assert unit.command(Store(0)) == Outcome.DONE


def test_a_flash_that_takes_nothing_is_told_and_the_old_settings_hold(tmp_path):
    # A wrong first key locks flash until the next reset (datasheet, chapter "Flash Memory").
    image = built_with_fault(tmp_path, "hal/flash.c", ("FLKEY = 0xA5;", "FLKEY = 0xA6;"))
    with stepped_unit("--laps", "0", image=image) as unit:
        unit.greet()
        assert unit.command(PLAN) == Outcome.DONE
        assert unit.command(Store(0)) == Outcome.FLASH_FAILED
        assert settings(unit).stored == 0
        assert unit.command(Reset(0)) == Outcome.DONE
        assert unit.receive(Hello).serial == 1
        assert settings(unit) == DEFAULT


@pytest.mark.parametrize(
    ("first", "second", "serial"),
    [
        (1, 2, 22),
        (2, 1, 11),
        (0xFFFF, 0, 22),  # generations go round
        (0, 0xFFFF, 11),
    ],
)
def test_the_page_of_the_higher_generation_holds(tmp_path, first, second, serial):
    pages = {FIRST_PAGE: page(struct.pack("<HI", first, 11)), SECOND_PAGE: page(struct.pack("<HI", second, 22))}
    with stepped_unit("--laps", "0", image=with_flash(IMAGE, pages, tmp_path / "two.ihx")) as unit:
        assert unit.greet().serial == serial


def test_a_page_that_is_not_sound_does_not_hold(tmp_path):
    spoilt = bytearray(page(struct.pack("<HI", 9, 22)))
    spoilt[6] ^= 0x10
    pages = {FIRST_PAGE: page(struct.pack("<HI", 1, 11)), SECOND_PAGE: bytes(spoilt)}
    with stepped_unit("--laps", "0", image=with_flash(IMAGE, pages, tmp_path / "spoilt.ihx")) as unit:
        assert unit.greet().serial == 11


def test_a_unit_without_a_sound_page_says_so_and_can_store_all_the_same(tmp_path):
    pages = {FIRST_PAGE: bytes(16), SECOND_PAGE: bytes(16)}
    with stepped_unit("--laps", "0", image=with_flash(IMAGE, pages, tmp_path / "none.ihx")) as unit:
        assert unit.greet().serial == NO_SERIAL
        assert unit.command(PLAN) == unit.command(Store(0)) == Outcome.DONE
        power_cycle(unit)
        assert settings(unit) == replace(DEFAULT, **PLAN_FIELDS)


def test_what_a_shorter_page_lacks_has_its_default(tmp_path):
    plan = struct.pack("<hHBHHHHB", *PLAN_FIELDS.values())
    pages = {FIRST_PAGE: page(struct.pack("<HI", 1, 5) + plan)}
    with stepped_unit("--laps", "0", image=with_flash(IMAGE, pages, tmp_path / "short.ihx")) as unit:
        assert unit.greet().serial == 5
        assert settings(unit) == replace(DEFAULT, **PLAN_FIELDS)


def test_a_stored_plan_that_no_unit_can_do_is_left_alone(tmp_path):
    plan = struct.pack("<hHBHHHHB", -24576, 4096, 65, 60, 600, 100, 20, 1)
    pages = {FIRST_PAGE: page(struct.pack("<HI", 1, 5) + plan)}
    with stepped_unit("--laps", "0", image=with_flash(IMAGE, pages, tmp_path / "wrong.ihx")) as unit:
        assert unit.greet().serial == 5
        assert settings(unit) == replace(DEFAULT, stored=0)


@pytest.mark.parametrize(
    ("speed_and_ramp_ms", "in_force"),
    [
        ((600, 0), (600, 50)),
        ((501, 49), (501, 50)),
        ((600, 50), (600, 50)),
        ((500, 0), (500, 0)),
        ((801, 100), (800, 100)),
        ((1000, 0), (800, 50)),
    ],
)
def test_a_stored_plan_of_older_firmware_gets_a_speed_that_the_motor_follows_and_the_ramp_that_it_needs(
    tmp_path, speed_and_ramp_ms, in_force
):
    # Firmware before 0.6 took 1000 half steps/s, before 0.4 any ramp; firmware/README.md, CONFIGURE: 800 at most, and
    # 50 ms or more over 500.
    stored = PLAN_FIELDS | dict(zip(("top_speed", "ramp_ms"), speed_and_ramp_ms, strict=True))
    eased = stored | dict(zip(("top_speed", "ramp_ms"), in_force, strict=True))
    pages = {FIRST_PAGE: page(struct.pack("<HI", 1, 5) + struct.pack("<hHBHHHHB", *stored.values()))}
    with stepped_unit("--laps", "0", image=with_flash(IMAGE, pages, tmp_path / "older.ihx")) as unit:
        assert unit.greet().serial == 5
        at_first = replace(DEFAULT, **eased, stored=int(eased == stored))
        assert settings(unit) == at_first
        assert unit.command(Store(0)) == Outcome.DONE
        assert power_cycle(unit).serial == 5
        assert settings(unit) == replace(at_first, stored=1)
