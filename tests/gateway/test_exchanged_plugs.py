"""Plugs that are exchanged while every line stays open: no sweep goes under another unit, nor is forgotten for it."""

from dataclasses import replace
from random import Random

import pytest
from gateway.bad_line import Faults
from gateway.link_rig import SERIAL, SWEEPING, Rig, of_type
from gateway.model_unit import ModelUnit

from noctule_gateway.link.enquiries import HELLO_EVERY_S
from noctule_gateway.link.events import Identified, Refused
from noctule_gateway.link.voucher import VOUCHES_FOR_S
from noctule_gateway.wire import frames
from noctule_gateway.wire.frames import PROTOCOLS, Ack2, Sweep, Sweep2

OTHER = SERIAL + 1


def run(rigs: tuple[Rig, Rig], duration_s: float) -> None:
    """Let the same time pass on both lines."""
    for rig in rigs:
        rig.run(duration_s)


def exchange(rigs: tuple[Rig, Rig]) -> None:
    """Exchange the plugs by hand: both lines stay open, and nothing comes for a moment."""
    for rig in rigs:
        rig.cut(VOUCHES_FOR_S)
    rigs[0].unit, rigs[1].unit = rigs[1].unit, rigs[0].unit


@pytest.mark.parametrize("protocols", [(3, 3), (2, 2), (3, 2)])
def test_every_sweep_is_committed_once_under_its_own_unit_however_often_plugs_are_exchanged(
    protocols: tuple[int, int],
) -> None:
    random = Random(1)
    units = [
        ModelUnit(serial, sweep_s=1.0, protocol=protocol)
        for serial, protocol in zip((SERIAL, OTHER), protocols, strict=True)
    ]
    wanted = replace(SWEEPING, plan=None)
    faults = Faults(corrupted=0.001, delay_s=0.02)
    rigs = tuple(Rig(unit, wanted, faults, serial=unit.serial) for unit in units)
    assert len(rigs) == 2
    for rig in rigs:
        rig.commit_fails = 0.3
    for _ in range(4):
        run(rigs, random.uniform(0.1, 8.0))
        exchange(rigs)
    for rig in rigs:
        rig.commit_fails = 0.0
        rig.run(10.0)
        rig.link.order(frames.Stop(0))
        rig.run(5.0)
        assert len(rig.unit.made) > 20
        assert sorted(rig.committed, key=lambda sweep: sweep.sequence) == rig.unit.made
        assert not rig.unit.ring


def test_an_acknowledgement_that_reaches_the_other_unit_costs_it_nothing() -> None:
    unit, other = ModelUnit(SERIAL), ModelUnit(OTHER)
    rig = Rig(unit)
    rig.run(1.0)
    sweep, others = unit.make_sweep(rig.now_s), other.make_sweep(rig.now_s)
    assert (sweep.boot, sweep.sequence) == (others.boot, others.sequence)
    rig.link.committed(sweep, rig.now_s)
    other.receive(rig.link.output(rig.now_s), rig.now_s)
    assert list(other.ring) == [others]


def test_a_sweep_that_names_another_unit_has_that_unit_refused_at_once() -> None:
    rig = Rig(ModelUnit(SERIAL))
    rig.run(5.0)
    rig.unit = ModelUnit(OTHER)
    rig.unit.make_sweep(rig.now_s)
    events = rig.run(0.5)
    assert "unit 8 answers where the site file has 7" in str(of_type(events, Refused)[0].error)
    assert not rig.link.identified
    assert rig.committed == []
    assert len(rig.unit.ring) == 1


def test_the_unit_is_served_again_when_its_plug_is_back() -> None:
    unit, other = ModelUnit(SERIAL), ModelUnit(OTHER)
    rig = Rig(unit)
    rig.run(1.0)
    rig.unit = other
    other.make_sweep(rig.now_s)
    rig.run(1.0)
    rig.unit = unit
    sweep = unit.make_sweep(rig.now_s)
    events = rig.run(6.0)  # REFUSED_RETRY_S and a little
    assert [event.rebooted for event in of_type(events, Identified)] == [False]
    assert rig.committed == [sweep]


def test_a_sweep_of_protocol_2_is_taken_only_soon_after_a_hello_of_its_unit() -> None:
    unit = ModelUnit(SERIAL, protocol=2)
    rig = Rig(unit)
    rig.run(VOUCHES_FOR_S + 2.0)
    hellos = sum(isinstance(frame, frames.AskHello) for frame in unit.heard)
    sweep = unit.make_sweep(rig.now_s)
    rig.run(0.2)
    assert sum(isinstance(frame, frames.AskHello) for frame in unit.heard) == hellos + 1
    assert rig.committed == [sweep]
    assert not unit.ring


def test_a_commit_that_takes_long_is_not_acknowledged_to_a_unit_of_protocol_2_that_may_be_another() -> None:
    unit, other = ModelUnit(SERIAL, protocol=2), ModelUnit(OTHER, protocol=2)
    rig = Rig(unit)
    rig.run(1.0)
    sweep, others = unit.make_sweep(rig.now_s), other.make_sweep(rig.now_s)
    assert (sweep.boot, sweep.sequence) == (others.boot, others.sequence)
    rig.link.committed(sweep, rig.now_s + VOUCHES_FOR_S)
    other.receive(rig.link.output(rig.now_s), rig.now_s)
    assert list(other.ring) == [others]


@pytest.mark.parametrize("protocols", [(3, 3), (2, 2), (3, 2), (2, 3)])
@pytest.mark.parametrize("hand_s", [VOUCHES_FOR_S, 1.8])
def test_an_order_that_is_pending_when_plugs_are_exchanged_reaches_no_other_unit(
    protocols: tuple[int, int], hand_s: float
) -> None:
    units = [ModelUnit(serial, protocol=protocol) for serial, protocol in zip((SERIAL, OTHER), protocols, strict=True)]
    rigs = [Rig(unit, serial=unit.serial) for unit in units]
    random = Random(1)
    for rig in rigs:
        rig.run(random.uniform(1.0, 2.0))
    orders = [(rig, rig.link.order(frames.SetWaypoint(0, rig.unit.serial))) for rig in rigs if rig.link.identified]
    assert len(orders) == 2
    for rig in rigs:
        rig.cut(hand_s)
    rigs[0].unit, rigs[1].unit = rigs[1].unit, rigs[0].unit
    for rig in rigs:
        rig.run(4.0)  # ORDER_ATTEMPTS
    assert all(rig.settled(ticket) for rig, ticket in orders)
    for unit in units:
        assert {order for order in unit.carried_out if isinstance(order, frames.SetWaypoint)} <= {
            frames.SetWaypoint(0, unit.serial)
        }


def test_an_order_that_was_refused_by_another_unit_fails_at_once_and_says_so() -> None:
    unit, other = ModelUnit(SERIAL), ModelUnit(OTHER)
    rig = Rig(unit)
    rig.run(5.0)
    rig.unit = other
    ticket = rig.link.order(frames.Single(0))
    rig.run(0.2)
    assert "another unit was on the line and refused it" in str(rig.settled(ticket).error)
    assert (other.carried_out, other.made) == ([], [])
    assert not rig.link.identified


def test_an_order_reaches_a_unit_of_protocol_2_soon_after_a_hello_and_is_not_repeated_later() -> None:
    unit = ModelUnit(SERIAL, protocol=2)
    rig = Rig(unit)
    rig.run(VOUCHES_FOR_S + 2.0)
    hellos = sum(isinstance(frame, frames.AskHello) for frame in unit.heard)
    ticket = rig.link.order(frames.SetWaypoint(0, 3))
    rig.run(0.2)
    assert rig.settled(ticket).error is None
    assert sum(isinstance(frame, frames.AskHello) for frame in unit.heard) == hellos + 1
    ticket = rig.link.order(frames.SetWaypoint(0, 4))
    rig.cut(VOUCHES_FOR_S + 0.5)
    assert "did not answer" in str(rig.settled(ticket).error)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_orders_of_either_protocol_come_through_a_bad_line(protocol: int) -> None:
    unit = ModelUnit(SERIAL, protocol=protocol)
    rig = Rig(unit, replace(SWEEPING, plan=None), Faults(corrupted=0.01, delay_s=0.02))
    rig.run(5.0)
    tickets = [rig.link.order(frames.SetWaypoint(0, waypoint)) for waypoint in range(20)]
    rig.run(20.0)
    assert sum(rig.settled(ticket).error is None for ticket in tickets) >= 15


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_sweeps_of_both_protocols_are_taken_from_a_unit_that_was_updated_or_went_back(protocol: int) -> None:
    unit = ModelUnit(SERIAL, protocol=2)
    for protocol_then in (2, 3, 2, 3):
        unit.protocol = protocol_then
        unit.make_sweep(50.0)
    unit.protocol = protocol
    unit.reset(99.0)
    rig = Rig(unit)
    rig.run(5.0)
    assert {type(sweep) for sweep in unit.made} == {Sweep, Sweep2}
    assert rig.committed == unit.made
    assert not unit.ring
    if protocol == 2:
        acknowledgements = [frame for frame in unit.heard if isinstance(frame, frames.Ack | Ack2)]
        assert {type(frame) for frame in acknowledgements} == {Ack2}


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_no_clock_and_no_status_of_the_other_unit_is_believed_though_it_sends_no_sweep(protocol: int) -> None:
    rig = Rig(ModelUnit(SERIAL, protocol=protocol))
    rig.run(HELLO_EVERY_S + 1.0)  # a HELLO has just been answered
    rig.cut(VOUCHES_FOR_S)
    rig.unit = ModelUnit(OTHER, born_s=-1000.0, protocol=protocol)  # its ticks are ahead
    events = rig.run(2 * HELLO_EVERY_S)
    assert {type(event) for event in events} == {Refused}
