"""Power cuts at the flash operations of an update: never a dead unit (firmware/README.md, Update)."""

from pathlib import Path
from random import Random
from typing import NamedTuple

import pytest
from firmware.images import VERSION, with_flash
from firmware.stepped_unit import IMAGE, SteppedUnit, stepped_unit
from firmware.update_rig import Update, staged, update

from noctule_gateway.update.image import Image
from noctule_gateway.update.outcome import Step, Updated
from noctule_gateway.wire.frames import AskHello, Hello, Loader

OLD, NEW = VERSION, "0.9.0"
DESCRIPTION_BYTES = 16
# Longer than it takes to copy 42 pages and to start.
BACK_WITHIN_S = 6.0


class Operations(NamedTuple):
    """Flash operations of one update, counted from power-up: the first of the kind, and the last."""

    staging: range
    copy: range
    last_bytes: range  # of the copy: the description
    start: range  # the attempt, the boot number, the confirmation


def operations_of(image: Path, new: Image) -> Operations:
    """Where in an update of a unit with ``image`` the flash operations are, found by one that nothing disturbs."""
    with stepped_unit("--laps", "0", image=image) as unit:
        unit.greet()
        begun = unit.truth["flash_operations"]
        run = Update(unit, new)
        assert run.run(until_step=Step.INSTALLING) is None
        sent = unit.truth["flash_operations"]
        assert run.run(until_step=Step.STARTING) is None
        copied = unit.truth["flash_operations"]
        assert run.run() == Updated(OLD)
        ended = unit.truth["flash_operations"]
    return Operations(
        range(begun + 1, sent + 1),
        range(sent + 1, copied + 1),
        range(copied + 1 - DESCRIPTION_BYTES, copied + 1),
        range(copied + 1, ended + 1),
    )


@pytest.fixture(scope="module")
def half_way(tmp_path_factory, new_image) -> Path:
    """The firmware of a unit that has the update in staging, and is to install it."""
    return with_flash(IMAGE, staged(new_image), tmp_path_factory.mktemp("half_way") / "image.hex")


@pytest.fixture(scope="module")
def whole_operations(new_image) -> Operations:
    return operations_of(IMAGE, new_image)


@pytest.fixture(scope="module")
def install_operations(half_way, new_image) -> Operations:
    return operations_of(half_way, new_image)


def version_after(unit: SteppedUnit) -> str | None:
    """The version of the application that the unit runs by itself; None if it waits in its loader."""
    met = unit.receive_either(Hello, Loader, BACK_WITHIN_S)
    return met.version if isinstance(met, Hello) else None


def cut_and_leave(image: Path, new: Image, operation: int, seed: int) -> str | None:
    """Cut the power at a flash operation of an update, whose host goes away too; the version that then runs by itself.

    Whatever that is, another update succeeds.
    """
    with stepped_unit("--laps", "0", "--seed", str(seed), image=image) as unit:
        unit.greet()
        unit.inject("power_cut_at_flash_operation", number=operation - unit.truth["flash_operations"])
        assert Update(unit, new).run(until_operation=operation) is None
        version = version_after(unit)
        assert isinstance(update(unit, new, again=True), Updated)
        assert unit.ask(AskHello(0), Hello).version == NEW
        return version


def cut_and_go_on(image: Path, new: Image, operations: list[int], seed: int) -> None:
    """Cut the power at flash operations of an update, whose host does not give up."""
    with stepped_unit("--laps", "0", "--seed", str(seed), image=image) as unit:
        unit.greet()
        run = Update(unit, new)
        for operation in sorted(operations):
            unit.inject("power_cut_at_flash_operation", number=operation - unit.truth["flash_operations"])
            if run.run(until_operation=operation) is not None:
                break
        assert run.run() == Updated(OLD)
        assert unit.ask(AskHello(0), Hello).version == NEW


def test_a_cut_while_staging_is_written_leaves_the_old_application(whole_operations, new_image):
    random = Random(1)
    for seed in range(4):
        operation = random.choice(whole_operations.staging)
        assert cut_and_leave(IMAGE, new_image, operation, seed) == OLD, (operation, seed)


@pytest.mark.parametrize("seed", range(6))
def test_a_cut_at_the_moment_that_decides_leaves_the_old_application_or_the_new(
    half_way, install_operations, new_image, seed
):
    assert cut_and_leave(half_way, new_image, install_operations.copy[0], seed) in (OLD, NEW)


def test_a_cut_during_the_copy_ends_with_the_new_application(half_way, install_operations, new_image):
    random = Random(2)
    for seed in range(6):
        operation = random.choice(install_operations.copy[1:])
        assert cut_and_leave(half_way, new_image, operation, seed) == NEW, (operation, seed)


@pytest.mark.parametrize("place", range(DESCRIPTION_BYTES))
def test_a_cut_at_any_byte_of_the_description_ends_with_the_new_application(
    half_way, install_operations, new_image, place
):
    operation = install_operations.last_bytes[place]
    assert cut_and_leave(half_way, new_image, operation, seed=place) == NEW


def test_a_cut_at_attempt_boot_number_or_confirmation_leaves_the_new_application(
    half_way, install_operations, new_image
):
    # firmware/README.md, Flash: a bit of each of the three
    assert len(install_operations.start) == 3
    for operation in install_operations.start:
        for seed in range(2):
            assert cut_and_leave(half_way, new_image, operation, seed) == NEW, (operation, seed)


@pytest.mark.parametrize("seed", range(3))
def test_an_update_goes_on_through_several_cuts(whole_operations, new_image, seed):
    random = Random(seed)
    everything = range(whole_operations.staging[0], whole_operations.start[-1])
    cut_and_go_on(IMAGE, new_image, random.sample(everything, 3), seed)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(10))
def test_cuts_anywhere_by_the_hundred(whole_operations, half_way, install_operations, new_image, seed):
    random = Random(1000 + seed)
    for _ in range(10):
        assert cut_and_leave(IMAGE, new_image, random.choice(whole_operations.staging), random.randrange(10**6)) == OLD
        assert (
            cut_and_leave(half_way, new_image, random.choice(install_operations.copy[1:]), random.randrange(10**6))
            == NEW
        )
        anywhere = range(whole_operations.staging[0], whole_operations.start[-1])
        cut_and_go_on(IMAGE, new_image, random.sample(anywhere, 5), random.randrange(10**6))
