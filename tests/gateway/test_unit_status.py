"""What an operator is told of a unit. Bits of RSTSRC: datasheet C8051F34x, chapter 11; notes: firmware/README.md."""

from dataclasses import replace

import pytest
from gateway.model_unit import ModelUnit

from noctule.messages_pb2 import UnitStatus
from noctule.site import FixedPose, Pose2, Sensor, Unit
from noctule_gateway.log.sweep_log import LogState
from noctule_gateway.status import reset_causes, unit_status
from noctule_gateway.status.service_quality import TOO_LATE_S, WINDOW_S, Lateness, LineQuality
from noctule_gateway.status.unit_state import UnitState
from noctule_gateway.wire import frames
from noctule_gateway.wire.codec import FrameReader, encode
from noctule_gateway.wire.frames import Hello, Loader, State, Status, Stay

UNIT = Unit("u1", 7, "socket://h:1", FixedPose(Pose2(0, 0, 0)), Sensor(), None, False, 0.0)
HELLO = Hello(1, 2, 7, 0, 2, 0, 5, 0x02, 0, 3000)
POWER, WATCHDOG, SOFTWARE, PIN = 0x02, 0x08, 0x10, 0x01


def says(frame: frames.Frame) -> Status:
    """The model's STATUS."""
    unit = ModelUnit()
    unit.receive(encode(frame), 1.0)
    (answer,) = FrameReader().feed(unit.output(1.0))
    assert isinstance(answer, Status)
    return answer


STATUS = says(frames.AskStatus(1))
GOOD = UnitState().identified(HELLO).said(STATUS)


def test_a_unit_that_turns_is_shown_as_turning_with_its_chips_temperature() -> None:
    told = unit_status.message(replace(GOOD, status=replace(STATUS, state=State.TURNING)), UNIT)
    assert (told.state, told.detail) == (UnitStatus.STATE_TURNING, "")
    assert told.chip_temperature_c == 31.5
    unmeasured = unit_status.message(replace(GOOD, status=replace(STATUS, temperature=frames.NO_TEMPERATURE)), UNIT)
    assert not unmeasured.HasField("chip_temperature_c")


def test_a_home_switch_that_does_not_open_is_told_in_words() -> None:
    told = unit_status.message(replace(GOOD, status=replace(STATUS, state=State.FAULT, fault=2)), UNIT)
    assert told.state == UnitStatus.STATE_FAULT
    assert "does not open" in told.detail


def test_a_unit_that_pings_out_of_turn_says_why_where_nothing_graver_is_wrong() -> None:
    known = replace(GOOD, out_of_turn="units near it hear its pings")
    assert unit_status.message(known, UNIT).detail == "units near it hear its pings"
    assert unit_status.message(replace(known, bad_line=True), UNIT).detail.startswith("much of what it sends")
    assert unit_status.unit_counters(replace(STATUS, flags=0x0A))["unit_in_turn"] == 1
    assert unit_status.unit_counters(STATUS)["unit_in_turn"] == 0


def test_the_stack_that_is_left_is_among_the_counters() -> None:
    assert unit_status.unit_counters(STATUS)["unit_stack_free_bytes"] == 40


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        (Stay.ASKED, "begun and not ended"),
        (Stay.NO_APPLICATION, "no sound firmware"),
        (Stay.NOT_CONFIRMED, "never answered"),
        (Stay.FLASH_FAILED, "flash does not hold"),
    ],
)
def test_a_unit_in_its_loader_is_shown_with_why_and_what_to_do(reason: Stay, words: str) -> None:
    loader = Loader(0, 2, 7, 1, 1, reason, 0xFF, 0xFF, 0xFF)
    told = unit_status.message(GOOD.lost(unit_status.in_loader(loader, UNIT, "attic"), loader), UNIT)
    assert (told.state, told.serial) == (UnitStatus.STATE_LOADER, 7)
    assert words in told.detail
    assert "noctule rpc attic u1 update --image" in told.detail


def test_a_unit_that_is_being_updated_is_shown_in_its_loader_with_how_far_it_is() -> None:
    told = unit_status.message(GOOD.lost("no answer").updating("updating: sending, 17 of 42 pages"), UNIT)
    assert (told.state, told.detail) == (UnitStatus.STATE_LOADER, "updating: sending, 17 of 42 pages")
    assert told.firmware == "0.2.0"


def test_a_full_ring_is_the_gateways_fault_where_the_gateway_is_late() -> None:
    full = replace(GOOD, status=replace(STATUS, state=State.WAITING))
    assert "late" not in unit_status.message(full, UNIT).detail
    assert "late" in unit_status.message(replace(full, late=True), UNIT).detail
    assert "late" in unit_status.message(replace(GOOD, late=True), UNIT).detail


@pytest.mark.parametrize(
    ("cause", "note", "met_before", "words"),
    [
        (WATCHDOG, 0, False, "watchdog"),
        (SOFTWARE, 2, False, "stack"),
        (SOFTWARE, 5, True, "greeted"),
        (POWER, 0, True, "supply"),
        (PIN, 0, True, "pin"),
    ],
)
def test_a_reset_that_nobody_ordered_is_worth_a_warning(cause: int, note: int, met_before: bool, words: str) -> None:
    assert words in reset_causes.warning(replace(HELLO, reset_cause=cause, reset_note=note), met_before)


@pytest.mark.parametrize(("cause", "note", "met_before"), [(POWER, 0, False), (SOFTWARE, 1, True), (SOFTWARE, 4, True)])
def test_a_first_power_up_and_a_reset_that_was_ordered_are_not(cause: int, note: int, met_before: bool) -> None:
    assert reset_causes.warning(replace(HELLO, reset_cause=cause, reset_note=note), met_before) == ""


def test_a_delay_counts_for_ten_seconds_at_least_and_twenty_at_most() -> None:
    lateness = Lateness()
    for second in range(60):
        lateness.note(2 * TOO_LATE_S if second == 15 else 0.01, float(second))
        if 15 <= second <= 24:
            assert lateness.worst_s(second) == 2 * TOO_LATE_S
        if second < 15 or second > 35:
            assert lateness.worst_s(second) == 0.01


def test_a_delay_is_forgotten_though_nothing_comes_after_it() -> None:
    lateness = Lateness()
    lateness.note(2 * TOO_LATE_S, 100.0)
    assert lateness.too_late(105.0)
    assert not lateness.too_late(100.0 + 2 * WINDOW_S)


def test_a_line_that_corrupts_a_tenth_is_told_until_it_is_good_again() -> None:
    quality = LineQuality()
    told = []
    read = bad = 0
    for one_in in (0, 5, 20, 0):
        for frame in range(400):
            hit = bool(one_in) and frame % one_in == 0
            read, bad = read + (not hit), bad + hit
            quality.note(read, bad)
        told.append(quality.bad)
    assert told == [False, True, True, False]
    assert "check cable" in unit_status.message(replace(GOOD, bad_line=True), UNIT).detail


def test_a_single_frame_that_is_hit_is_not_worth_a_word() -> None:
    quality = LineQuality()
    quality.note(0, 1)
    assert not quality.bad


def test_damage_to_a_units_log_is_counted_and_named_unless_something_is_wrong_now() -> None:
    log = LogState("L", head=9, damaged=3, damage="its log was damaged, 3 of its sweeps are lost")
    told = unit_status.message(replace(GOOD, log=log), UNIT)
    assert (told.log_damaged, told.detail) == (3, "its log was damaged, 3 of its sweeps are lost")
    assert unit_status.detail(replace(GOOD, log=log).lost("the line is cut"), UNIT) == "the line is cut"


def test_a_unit_that_is_lost_keeps_what_it_last_said_and_is_well_again_once_it_is_identified() -> None:
    assert UnitState().trouble == "not connected yet"
    lost = GOOD.lost("no answer")
    assert (lost.trouble, lost.status, lost.hello) == ("no answer", STATUS, HELLO)
    assert lost.identified(HELLO) == GOOD
    loader = Loader(0, 2, 7, 1, 1, Stay.ASKED, 0xFF, 0xFF, 0xFF)
    assert GOOD.lost("in its loader", loader).lost("the line was cut").loader is None
