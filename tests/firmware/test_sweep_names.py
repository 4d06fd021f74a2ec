"""What names a sweep, in SWEEP and in ACK, on the real firmware; and the sweeps and the firmware of protocol 2."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from firmware.images import END_RECORD, VERSION, built_with_fault, of_protocol_2
from firmware.stepped_unit import IMAGE, SteppedUnit, stepped_unit
from firmware.update_rig import SERIAL, update

from noctule_gateway.update.admission import Admission
from noctule_gateway.update.image import Image
from noctule_gateway.update.outcome import Updated
from noctule_gateway.wire.frames import (
    Ack2,
    AskHello,
    AskStatus,
    Hello,
    Outcome,
    SetWaypoint,
    Single,
    Status,
    Sweep,
    Sweep2,
)

APPLICATION = 0x1000


@pytest.fixture(scope="module")
def protocol_2(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return of_protocol_2(tmp_path_factory.mktemp("protocol-2"))


@pytest.fixture
def unit() -> Iterator[SteppedUnit]:
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        yield unit


def one_sweep(unit: SteppedUnit) -> Sweep:
    assert unit.command(Single(0)) == Outcome.DONE
    return unit.receive(Sweep, 60.0)


def waiting(unit: SteppedUnit) -> int:
    return unit.ask(AskStatus(0), Status).sweeps_waiting


def update_of(whole: Path, place: Path) -> Image:
    """The application of ``whole`` as an update."""
    records = [record for record in whole.read_text().split() if int(record[3:7], 16) >= APPLICATION]
    place.write_text("\n".join([*records, END_RECORD]))
    return Admission(takes_unsigned=True).load(place)


def test_a_sweep_names_its_unit_and_its_life(unit):
    hello = unit.ask(AskHello(0), Hello)
    sweep = one_sweep(unit)
    assert (sweep.serial, sweep.life) == (hello.serial, hello.life)
    assert (hello.serial, bool(hello.life)) == (SERIAL, True)


def test_only_an_acknowledgement_by_the_whole_name_lets_the_unit_forget_its_sweep(unit):
    sweep = one_sweep(unit)
    for name in ("boot", "sequence", "serial", "life"):
        unit.acknowledge(replace(sweep, **{name: getattr(sweep, name) + 1}))
    unit.send(Ack2(sweep.boot, sweep.sequence))
    assert waiting(unit) == 1
    unit.acknowledge(sweep)
    assert waiting(unit) == 0


def test_an_acknowledgement_that_comes_while_the_sweep_goes_out_again_is_held_against_its_whole_name(unit):
    sweep = one_sweep(unit)
    # A frame of 137 bytes takes 11.9 ms at 115200 bit/s, and a HELLO's answer before it 2 ms.
    for wrong, left in ((replace(sweep, serial=SERIAL + 1), 1), (sweep, 0)):
        unit.send(AskHello(1))
        unit.receive(Hello)
        unit.run(0.004)
        unit.acknowledge(wrong)
        assert unit.receive(Sweep) == sweep
        assert waiting(unit) == left


def test_sweeps_that_waited_before_an_update_from_protocol_2_are_delivered_as_they_were(protocol_2):
    with stepped_unit("--laps", "0", image=protocol_2) as unit:
        assert unit.greet().protocol == 2
        assert unit.command(Single(0)) == Outcome.DONE
        old = unit.receive(Sweep2, 60.0)
        assert update(unit, Admission(takes_unsigned=True).load(IMAGE.with_name("update.hex"))) == Updated("0.2.0")
        assert unit.receive(Sweep2) == old
        assert unit.command(Single(0)) == Outcome.DONE
        unit.acknowledge(old)
        assert unit.receive(Sweep, 60.0).serial == SERIAL
        assert waiting(unit) == 1


def test_sweeps_that_waited_before_an_update_back_to_protocol_2_are_acknowledged_by_boot_and_sequence(
    unit, protocol_2, tmp_path
):
    sweep = one_sweep(unit)
    assert update(unit, update_of(protocol_2, tmp_path / "update.hex")) == Updated(VERSION)
    assert unit.ask(AskHello(0), Hello).protocol == 2
    assert unit.receive(Sweep) == sweep
    unit.send(Ack2(sweep.boot, sweep.sequence))
    assert waiting(unit) == 0


def test_a_chip_that_got_another_serial_number_forgets_the_sweeps_of_the_one_before(tmp_path):
    # No programmer is simulated: this firmware has its waypoint added to its serial number.
    image = built_with_fault(
        tmp_path,
        "src/settings.c",
        (
            "    return flash_read16(page + SETTINGS_SERIAL) |",
            "    return (unit_waypoint() & 0xFF) + flash_read16(page + SETTINGS_SERIAL) |",
        ),
    )
    with stepped_unit("--laps", "0", image=image) as unit:
        unit.greet()
        assert unit.command(SetWaypoint(0, 0)) == Outcome.DONE
        assert one_sweep(unit).serial == SERIAL
        assert unit.command(SetWaypoint(0, 4)) == Outcome.DONE
        later = one_sweep(unit)
        assert (later.serial, later.sequence) == (SERIAL + 4, 1)
        assert waiting(unit) == 1
