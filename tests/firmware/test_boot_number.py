"""Boot numbers: they tell the sweeps of one boot from those of another, so they never come twice."""

from pathlib import Path

import pytest
from firmware.images import with_flash
from firmware.stepped_unit import IMAGE, SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import Hello, Outcome, Reset

# firmware/README.md, Flash: base, its complement, then a bit for each boot in a page of 512 bytes
FIRST_PAGE, SECOND_PAGE = 0xF200, 0xF400
BOOTS_PER_PAGE = (512 - 4) * 8
# Erasing the other page, its four bytes of header, one bit.
OPERATIONS_OF_A_ROLL_OVER = 1 + 4 + 1


def boot_page(base: int, boots: int) -> bytes:
    """A page in which so many boots are counted."""
    tally = ((1 << BOOTS_PER_PAGE) - 1) >> boots << boots
    return base.to_bytes(2, "little") + (~base & 0xFFFF).to_bytes(2, "little") + tally.to_bytes(508, "little")


def reset(unit: SteppedUnit) -> int:
    assert unit.command(Reset(0)) == Outcome.DONE
    return unit.receive(Hello).boot


def image(folder: Path, pages: dict[int, bytes]) -> Path:
    return with_flash(IMAGE, pages, folder / "boots.ihx")


def test_boots_are_counted_one_by_one():
    with stepped_unit("--laps", "0") as unit:
        first = unit.greet().boot
        assert first == 1
        assert [reset(unit) for _ in range(20)] == list(range(2, 22))


@pytest.mark.parametrize(
    ("full", "base", "other"),
    [(FIRST_PAGE, 0, SECOND_PAGE), (SECOND_PAGE, 4064, FIRST_PAGE), (FIRST_PAGE, 0xEFE0, SECOND_PAGE)],
)
def test_a_page_that_is_used_up_is_followed_by_the_other(tmp_path, full, base, other):
    before = (base - BOOTS_PER_PAGE) & 0xFFFF
    pages = {full: boot_page(base, BOOTS_PER_PAGE - 2), other: boot_page(before, BOOTS_PER_PAGE)}
    with stepped_unit("--laps", "0", image=image(tmp_path, pages)) as unit:
        boots = [unit.greet().boot, *(reset(unit) for _ in range(12))]
    assert boots == [(base + BOOTS_PER_PAGE - 1 + boot) & 0xFFFF for boot in range(13)]


@pytest.mark.parametrize("seed", range(1, 4))
@pytest.mark.parametrize("operation", range(1, OPERATIONS_OF_A_ROLL_OVER + 1))
@pytest.mark.parametrize("second_page", [boot_page(0x1000 - BOOTS_PER_PAGE, BOOTS_PER_PAGE), b""], ids=["used", "new"])
def test_a_power_cut_at_any_flash_operation_of_a_roll_over_repeats_no_number(tmp_path, second_page, operation, seed):
    pages = {FIRST_PAGE: boot_page(0x1000, BOOTS_PER_PAGE - 1), SECOND_PAGE: second_page}
    with stepped_unit("--laps", "0", "--seed", str(seed), image=image(tmp_path, pages)) as unit:
        last = unit.greet().boot
        assert last == 0x1000 + BOOTS_PER_PAGE
        assert unit.command(Reset(0)) == Outcome.DONE
        unit.inject("power_cut_at_flash_operation", number=operation)
        after = unit.receive(Hello)
        # It was cut: what started then is a power-up, and the reset said nothing. Its number may be lost.
        assert after.reset_cause == 0x02
        assert after.boot - last in (1, 2)
        assert [reset(unit) for _ in range(3)] == [after.boot + 1, after.boot + 2, after.boot + 3]


@pytest.mark.parametrize("seed", range(1, 7))
def test_a_power_cut_while_a_boot_is_counted_repeats_no_number(seed):
    with stepped_unit("--laps", "0", "--seed", str(seed)) as unit:
        last = unit.greet().boot
        for _ in range(10):
            assert unit.command(Reset(0)) == Outcome.DONE
            unit.inject("power_cut_at_flash_operation", number=1)
            boot = unit.receive(Hello).boot
            assert boot - last in (1, 2)
            last = boot
