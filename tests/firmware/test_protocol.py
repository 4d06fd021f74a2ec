"""The unit's side of the serial protocol (firmware/README.md, Frames): the real firmware, on simulated time."""

import json
import zlib
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from cobs import cobs
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import (
    Ack,
    Ack2,
    AskClock,
    AskHello,
    AskMechanics,
    AskSettings,
    AskStatus,
    Clock,
    Configure,
    For,
    Hello,
    Home,
    Mechanics,
    NoEcho,
    Outcome,
    Rejected,
    Result,
    Settings,
    Single,
    Start,
    State,
    Status,
    Stop,
    Sweep,
)

VECTORS = json.loads((Path(__file__).parent / "vectors" / "frames.json").read_text())
ANSWERS = {
    AskHello.TYPE: Hello,
    AskStatus.TYPE: Status,
    AskClock.TYPE: Clock,
    AskSettings.TYPE: Settings,
    AskMechanics.TYPE: Mechanics,
}
UNREADABLE, UNKNOWN_TYPE, WRONG_LENGTH, TOO_LONG = 1, 2, 3, 4
# 64 readings in one place: the quickest way to the largest sweeps.
STARE = Configure(0, 0, 0, 64, 29, 600, 100, 0, 1)


@pytest.fixture
def unit():
    """A unit that stands in the paper's room; nobody presses its button."""
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        yield unit


def framed(content: bytes) -> bytes:
    return cobs.encode(content + zlib.crc32(content).to_bytes(4, "little")) + b"\0"


def is_request_to_a_unit(vector: dict) -> bool:
    return vector["type"] < 0x20 and vector["type"] not in (Ack.TYPE, Ack2.TYPE, For.TYPE)


@pytest.mark.parametrize("vector", list(filter(is_request_to_a_unit, VECTORS)), ids=lambda vector: vector["name"])
def test_every_request_of_the_vectors_is_answered(unit, vector):
    unit.send_bytes(bytes.fromhex(vector["wire"]))
    answer = unit.receive_either(ANSWERS.get(vector["type"], Result), Rejected)
    assert not isinstance(answer, Rejected)
    assert answer.request == vector["fields"]["request"]


def test_what_cannot_be_obeyed_is_rejected_with_its_reason_and_counted(unit):
    before = unit.ask(AskStatus(0), Status)
    sound = framed(bytes([AskStatus.TYPE, 1]))
    for wire, reason, kind in [
        (sound[:-2] + bytes([sound[-2] ^ 1]) + b"\0", UNREADABLE, 0),
        (b"\x09\x02\x01\0", UNREADABLE, 0),
        (framed(b"\x7f\x01"), UNKNOWN_TYPE, 0x7F),
        (framed(bytes([Start.TYPE, 1])), WRONG_LENGTH, Start.TYPE),
        (framed(bytes([AskStatus.TYPE]) + bytes(100)), TOO_LONG, AskStatus.TYPE),
    ]:
        unit.send_bytes(wire)
        assert unit.receive(Rejected) == Rejected(reason, kind)
    after = unit.ask(AskStatus(0), Status)
    assert (after.frames_bad - before.frames_bad, after.frames_unknown - before.frames_unknown) == (4, 1)
    assert after.state == State.IDLE


def test_empty_frames_are_nothing(unit):
    before = unit.ask(AskStatus(0), Status)
    unit.send_bytes(bytes(50))
    assert unit.ask(AskStatus(0), Status).frames_bad == before.frames_bad


def test_a_number_that_comes_round_again_is_a_new_request(unit):
    single = Single(7)
    unit.send(single)
    assert unit.receive(Result) == Result(7, Single.TYPE, Outcome.DONE)
    for request in range(8, 8 + 32):
        unit.send(AskClock(request))
        unit.receive(Clock)
    unit.send(single)
    assert unit.receive(Result) == Result(7, Single.TYPE, Outcome.BUSY)


def test_clock_stamps_are_in_order_and_half_a_millisecond_to_three_apart(unit):
    stamps = []
    for _ in range(20):
        clock = unit.ask(AskClock(0), Clock)
        # firmware/README.md: a round of the tasks lasts 2 ms, the answer is held for half a millisecond
        assert 2000 <= clock.sent - clock.received <= 12_000
        stamps += [clock.received, clock.sent]
    assert all(earlier < later for earlier, later in pairwise(stamps))


def test_a_sweep_is_sent_again_until_it_is_acknowledged(unit):
    assert unit.command(Single(0)) == Outcome.DONE
    first = unit.receive(Sweep, 30.0)
    assert unit.receive(Sweep) == first
    unit.acknowledge(replace(first, sequence=first.sequence + 1))
    assert unit.receive(Sweep) == first
    unit.acknowledge(first)
    status = unit.ask(AskStatus(0), Status)
    assert (status.sweeps_waiting, status.ring_used, status.sweeps_resent) == (0, 0, 2)


def receive_new(unit: SteppedUnit, sequence: int) -> Sweep:
    """The sweep of that number, acknowledged; the one before it may still be on its way."""
    while (sweep := unit.receive(Sweep, 60.0)).sequence != sequence:
        pass
    unit.acknowledge(sweep)
    return sweep


def test_sweeps_go_to_and_fro(unit):
    assert unit.command(Start(0, 0)) == Outcome.DONE
    sweeps = [receive_new(unit, sequence) for sequence in range(3)]
    directions = [sweep.flags & 1 for sweep in sweeps]
    assert directions in ([0, 1, 0], [1, 0, 1])
    for sweep, decreasing in zip(sweeps, directions, strict=True):
        # the default plan, reached to half a half step: 65536 / 4075.77 / 2 = 8
        plan = sorted(range(-24576, 24577, 4096), reverse=bool(decreasing))
        assert [reading.bearing for reading in sweep.readings] == pytest.approx(plan, abs=8.1)


def test_a_plan_of_long_ramps_does_not_spoil_homing(unit):
    # Such a ramp of 400 half steps is 35 degrees long; the cable ends 15 degrees past the home switch.
    ranges_m = []
    for sequence, ramp_ms in enumerate((100, 1000)):
        assert unit.command(Configure(0, -24576, 4096, 13, 60, 800, ramp_ms, 20, 1)) == Outcome.DONE
        assert unit.command(Home(0)) == Outcome.DONE
        unit.wait_for_state(State.HOMING)
        unit.wait_for_state(State.IDLE)
        assert unit.command(Single(0)) == Outcome.DONE
        readings = sorted(receive_new(unit, sequence).readings, key=lambda reading: reading.bearing)
        ranges_m.append([reading.echo / 4e6 * 343 / 2 for reading in readings])
    assert any(range_m < NoEcho.NO_SENSOR / 4e6 * 343 / 2 for range_m in ranges_m[0])
    # The room's noise is 3 mm; at the rim of the beam it may decide whether there is an echo.
    alike = [one == pytest.approx(other, abs=0.03) for one, other in zip(*ranges_m, strict=True)]
    assert sum(alike) >= 11


def test_stop_keeps_the_readings_made_by_then(unit):
    assert unit.command(Single(0)) == Outcome.DONE
    unit.wait_for_state(State.SWEEPING)
    while abs(unit.ask(AskStatus(0), Status).bearing) > 4096:
        unit.run(0.02)
    assert unit.command(Stop(0)) == Outcome.DONE
    assert 1 <= len(unit.receive(Sweep).readings) < 13


def test_a_full_ring_makes_the_unit_wait_and_loses_nothing(unit):
    assert unit.command(STARE) == unit.command(Start(0, 0)) == Outcome.DONE
    unit.wait_for_state(State.WAITING)
    status = unit.ask(AskStatus(0), Status)
    # 34 + 8 * 64 bytes in blocks of 12 make 552: five of them fit into 3,048
    assert (status.sweeps_waiting, status.ring_used) == (5, 5 * 552)
    assert [receive_new(unit, sequence).sequence for sequence in range(8)] == list(range(8))
