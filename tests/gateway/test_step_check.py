"""A unit's own check of its bearings in what the gateway makes of its sweeps: firmware/README.md."""

from dataclasses import replace
from math import degrees
from typing import Any

import pytest
from gateway.test_unit_status import STATUS

from noctule.faults import sentence
from noctule.messages_pb2 import FAULT_KIND_BLOCKED, FAULT_KIND_SLIPPED, FAULT_KIND_TURNED, Sweep, UnitFault
from noctule.site import Sensor, Unit, UnknownPose
from noctule_gateway.status import unit_status
from noctule_gateway.status.unit_state import UnitState
from noctule_gateway.unit.step_check import StepCheck
from noctule_gateway.wire import frames
from noctule_gateway.wire.frames import NO_SLIP, NO_TEMPERATURE, NO_WAYPOINT, Mechanics

TWO_DEGREES = 364  # 1/65536 turn
SLIPPED, SLIPPED_STATUS = 0x02, 0x04
THREE_HALF_STEPS, FOUR_HALF_STEPS = 48, 64  # of 4075.77 a turn, in 1/65536 turn
UNIT = Unit("u1", 7, "socket://h:1", UnknownPose(), Sensor(), None, False, 0.0)


def told(flags: int) -> frames.Sweep:
    return frames.Sweep(1, 1, 7, 1, 0, NO_WAYPOINT, NO_TEMPERATURE, flags, ())


def mechanics(slip: int) -> Mechanics:
    return Mechanics(1, slip, *14 * (0,))


def marked(check: StepCheck, flags: int, **fields: Any) -> Sweep:
    sweep = Sweep(clock_epoch="e1", **fields)
    sweep.start.FromSeconds(60)
    check.mark(sweep, told(flags))
    return sweep


def test_a_sweep_after_a_slip_is_flagged_and_makes_those_since_the_check_before_suspect() -> None:
    check = StepCheck("attic", "u1")
    first, second, right = marked(check, SLIPPED | 10 << 2), marked(check, SLIPPED), marked(check, 0)
    assert (list(first.faults), first.suspect_before) == ([FAULT_KIND_SLIPPED], 10)
    assert (list(second.faults), second.suspect_before) == ([FAULT_KIND_SLIPPED], 0)
    assert (list(right.faults), right.suspect_before) == ([], 0)


def test_what_the_sweeps_show_stays_and_more_suspects_win() -> None:
    sweep = marked(StepCheck("attic", "u1"), SLIPPED | 2 << 2, faults=[FAULT_KIND_BLOCKED], suspect_before=3)
    assert (list(sweep.faults), sweep.suspect_before) == ([FAULT_KIND_BLOCKED, FAULT_KIND_SLIPPED], 3)


def test_the_fault_says_by_how_much_since_when_and_what_to_do_until_a_check_finds_none() -> None:
    check = StepCheck("attic", "u1")
    check.checked(mechanics(TWO_DEGREES))
    marked(check, SLIPPED | 10 << 2)
    turned = UnitFault(kind=FAULT_KIND_TURNED)
    fault, other = check.added_to([turned, UnitFault(kind=FAULT_KIND_SLIPPED)], "e1")
    assert (fault.kind, other) == (FAULT_KIND_SLIPPED, turned)
    assert "bearings were off by +2.0 degrees" in sentence(fault)
    assert "since 1970-01-01 00:01 UTC" in sentence(fault) and "noctule rpc attic u1 home" in sentence(fault)
    assert not check.added_to([], "e2")[0].HasField("since")  # the clock has been set
    check.checked(mechanics(-TWO_DEGREES))
    marked(check, SLIPPED | 2 << 2)
    assert check.added_to([], "e1") == [fault]  # the log gets a line for each change of words
    marked(check, 0)
    assert check.added_to([], "e1") == []


@pytest.mark.parametrize("boot", [0x10001, 0x10002])  # the sweeps' own, and the next
def test_a_status_that_says_all_is_right_ends_the_fault_without_another_sweep(boot: int) -> None:
    check = StepCheck("attic", "u1")
    marked(check, SLIPPED)
    check.said(boot, replace(STATUS, flags=SLIPPED_STATUS, tick=9))
    assert check.added_to([], "e1") != []
    check.said(boot, replace(STATUS, flags=0, tick=9))
    assert check.added_to([], "e1") == []
    late = marked(check, SLIPPED)  # made before, at tick 0 of boot 1
    assert list(late.faults) == [FAULT_KIND_SLIPPED] and check.added_to([], "e1") == []
    check.mark(newer := Sweep(), replace(told(SLIPPED), boot=boot & 0xFFFF, start=10))
    assert list(newer.faults) == [FAULT_KIND_SLIPPED] and check.added_to([], "e1") != []


def test_an_amount_is_named_once_it_is_known_and_only_if_it_is_a_slip() -> None:
    check = StepCheck("attic", "u1")
    check.checked(mechanics(THREE_HALF_STEPS))  # an outage: the check since has found the bearings right
    marked(check, SLIPPED)
    assert "bearings were off; it has" in check.added_to([], "e1")[0].words
    check.checked(mechanics(-FOUR_HALF_STEPS))
    assert "bearings were off by -0.4 degrees; it has" in check.added_to([], "e1")[0].words
    check.checked(mechanics(TWO_DEGREES))
    assert "bearings were off by -0.4 degrees; it has" in check.added_to([], "e1")[0].words


@pytest.mark.parametrize(("slip", "slip_deg"), [(TWO_DEGREES, 2.0), (-TWO_DEGREES, -2.0), (NO_SLIP, None)])
def test_the_status_tells_the_latest_slip(slip: int, slip_deg: float | None) -> None:
    status = unit_status.message(UnitState().measured(mechanics(slip)), UNIT)
    assert status.HasField("slip_rad") == (slip_deg is not None)
    if slip_deg is not None:
        assert degrees(status.slip_rad) == pytest.approx(slip_deg, abs=0.01)
