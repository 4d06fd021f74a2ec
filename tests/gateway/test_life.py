"""Units whose boot numbers began again: their life tells what boot and sequence alone do not."""

from pathlib import Path

import pytest
from gateway.link_rig import SERIAL, Rig, of_type
from gateway.model_unit import ModelUnit

from noctule.messages_pb2 import Sweep
from noctule_gateway.errors import FrameError
from noctule_gateway.link.events import Identified
from noctule_gateway.link.peer import BootWatch
from noctule_gateway.log.log_file import Arrival, Retention
from noctule_gateway.log.sweep_log import SweepLog
from noctule_gateway.wire import frames
from noctule_gateway.wire.codec import decode, encode
from noctule_gateway.wire.frames import NO_LIFE, Hello

EARLIER, LATER = 0xA1, 0xB2
HELLO = Hello(1, 3, SERIAL, 0, 3, 0, 5, 0, 0, 3048)


def boot_of_life(boot: int, life: int) -> int:
    return Hello(1, 3, SERIAL, 0, 3, 0, boot, 0, 0, 3048, life).boot_of_life


def test_a_chip_that_was_erased_is_told_as_rebooted_though_it_has_the_same_boot_number() -> None:
    rig = Rig(ModelUnit(SERIAL, life=EARLIER))
    rig.run(1.0)
    rig.cut(1.0)
    rig.unit = ModelUnit(SERIAL, born_s=90.0, life=LATER)  # its ticks are ahead of those of before
    rig.link.connected(rig.now_s)
    assert [event.rebooted for event in of_type(rig.run(1.0), Identified)] == [True]


def test_the_same_sweep_in_another_life_is_another_sweep() -> None:
    rig = Rig(ModelUnit(SERIAL, life=EARLIER))
    rig.run(1.0)
    earlier = rig.unit.make_sweep(rig.now_s)
    rig.run(0.5)
    rig.unit = ModelUnit(SERIAL, life=LATER)
    later = rig.unit.make_sweep(101.0)
    rig.run(12.0)  # longer than from one HELLO to the next
    assert (earlier.boot, earlier.sequence, earlier.readings) == (later.boot, later.sequence, later.readings)
    assert rig.committed == [earlier, later]


def test_a_sweep_that_outlived_its_life_in_the_ring_is_taken() -> None:
    unit = ModelUnit(SERIAL, life=EARLIER)
    left = unit.make_sweep(50.0)
    unit.life = LATER
    rig = Rig(unit)
    rig.run(2.0)
    assert rig.committed == [left]
    assert not unit.ring


def test_a_sweep_of_another_life_has_the_unit_asked_once() -> None:
    watch = BootWatch()
    watch.begin(boot_of_life(5, LATER))
    assert not watch.doubted_by_sweep(boot_of_life(5, LATER))
    assert [watch.doubted_by_sweep(boot_of_life(5, EARLIER)) for _ in range(2)] == [True, False]
    assert watch.doubted_by_sweep(boot_of_life(6, LATER))
    assert not watch.doubted_by_sweep(boot_of_life(4, LATER))


def test_the_log_tells_the_time_of_a_boot_of_its_own_life_only(tmp_path: Path) -> None:
    log = SweepLog(tmp_path / "u1.sqlite", Retention())
    sweep = Sweep(site="s", unit="u1", boot=5, sequence=1, life=EARLIER, clock_error_s=0.25)
    committed: list[object] = []
    try:
        log.append(Arrival(bytes(16), 4_000_000, sweep), committed.append)
        log.append(Arrival(bytes(16), 4_000_000, Sweep(site="s", unit="u1", boot=6, sequence=1)), committed.append)
    finally:
        log.close()
    log = SweepLog(tmp_path / "u1.sqlite", Retention())
    try:
        assert len(committed) == 2
        assert log.last_of_boot(boot_of_life(5, EARLIER)) is not None
        assert log.last_of_boot(boot_of_life(5, LATER)) is None
        assert log.last_of_boot(boot_of_life(5, NO_LIFE)) is None
        assert log.last_of_boot(boot_of_life(6, NO_LIFE)) is not None
    finally:
        log.close()


def test_hello_is_read_with_a_life_and_without() -> None:
    assert decode(encode(HELLO)[:-1]) == HELLO
    with_life = Hello(**{**vars(HELLO), "life": 0xFFFFFFFF})
    assert decode(encode(with_life)[:-1]) == with_life
    assert len(encode(with_life)) == len(encode(HELLO)) + 4
    with pytest.raises(FrameError, match="does not fit"):
        encode(Hello(**{**vars(HELLO), "life": 1 << 32}))


def test_a_unit_of_protocol_2_has_no_life() -> None:
    unit = ModelUnit(SERIAL, protocol=2)
    rig = Rig(unit)
    sweep = unit.make_sweep(50.0)
    rig.run(1.0)
    assert isinstance(sweep, frames.Sweep2)
    assert of_type(rig.events, Identified)[0].hello.boot_of_life == sweep.boot_of_life == unit.boot
    assert rig.committed == [sweep]
