"""The link against a unit that speaks the protocol, over bad lines, in a time of the test's own."""

from dataclasses import replace

import pytest
from gateway.link_rig import AT_REST, PLAN, SERIAL, SWEEPING, Rig, of_type, with_lost_acknowledgement
from gateway.model_unit import ModelUnit

from noctule_gateway.errors import CommandError
from noctule_gateway.link.enquiries import QUICK_CLOCKS
from noctule_gateway.link.events import (
    ClockRead,
    Identified,
    InLoader,
    MechanicsRead,
    Refused,
    SettingsRead,
    Silent,
    StatusRead,
    SweepRead,
)
from noctule_gateway.link.link import LOADER_RETRY_S, Link
from noctule_gateway.link.peer import GARBLED_AFTER, SILENT_AFTER
from noctule_gateway.link.requests import ORDER_ATTEMPTS, TIMEOUT_S
from noctule_gateway.unit.plans import OWN_PLAN
from noctule_gateway.wire import frames
from noctule_gateway.wire.codec import encode


def test_hello_comes_first_then_eight_quick_clocks_the_status_and_the_settings() -> None:
    rig = Rig(ModelUnit(SERIAL))
    events = rig.run(0.3)
    assert isinstance(events[0], Identified)
    assert [type(event) for event in events[1:]] == [ClockRead] * QUICK_CLOCKS + [StatusRead, SettingsRead, ClockRead]


def test_the_settings_are_read_once_and_again_after_an_order_that_changes_them() -> None:
    rig = Rig(ModelUnit(SERIAL))
    seen = []
    for order in (None, replace(OWN_PLAN, count=9), frames.Store(0)):
        if order is not None:
            rig.link.order(order)
        assert len(of_type(rig.run(20.0), SettingsRead)) == 1
        assert rig.link.settings is not None
        seen.append((rig.link.settings.count, rig.link.settings.stored))
    assert seen == [(13, 1), (9, 0), (9, 1)]


def test_nothing_is_sent_to_a_unit_that_stores_its_settings_until_it_answers() -> None:
    unit = ModelUnit(SERIAL)
    rig = Rig(unit)
    rig.run(1.0)
    sweep = unit.make_sweep(rig.now_s)
    rig.link.order(frames.Store(0))
    store = rig.link.output(rig.now_s)
    rig.link.committed(sweep, rig.now_s)
    assert rig.link.output(rig.now_s + 0.02) == b""
    rig.link.receive(_answer(unit, store, rig.now_s), rig.now_s + 0.02)
    unit.receive(rig.link.output(rig.now_s + 0.02), rig.now_s + 0.02)
    assert not unit.ring


def _answer(unit: ModelUnit, request: bytes, now_s: float) -> bytes:
    unit.receive(request, now_s)
    return unit.output(now_s)


def test_clock_and_status_go_on_about_once_a_second() -> None:
    rig = Rig(ModelUnit(SERIAL))
    rig.run(1.0)
    events = rig.run(30.0)
    assert len(of_type(events, ClockRead)) == pytest.approx(30, abs=2)
    assert len(of_type(events, StatusRead)) == pytest.approx(30, abs=2)


def test_the_plan_and_the_start_of_the_site_file_are_given_once() -> None:
    unit = ModelUnit(SERIAL)
    Rig(unit, SWEEPING).run(20.0)
    assert unit.carried_out == [PLAN, frames.Start(0, 250)]


def test_a_unit_found_sweeping_is_stopped_for_its_plan_and_started_again() -> None:
    unit = ModelUnit(SERIAL)
    Rig(unit, SWEEPING).run(2.0)
    Rig(unit, replace(SWEEPING, running=False), first=90).run(2.0)
    assert unit.carried_out[2:] == [frames.Stop(0), PLAN, frames.Start(0, 250)]


def test_a_unit_that_was_reset_is_brought_back_to_what_the_operator_last_ordered() -> None:
    unit = ModelUnit(SERIAL)
    rig = Rig(unit, SWEEPING)
    rig.run(2.0)
    plan = replace(PLAN, count=9)
    tickets = [rig.link.order(order) for order in (frames.Stop(0), plan)]
    rig.run(1.0)
    assert [rig.settled(ticket).error for ticket in tickets] == [None, None]
    unit.reset(rig.now_s)
    unit.carried_out.clear()
    events = rig.run(3.0)
    assert [event.hello.boot for event in of_type(events, Identified)] == [2]
    assert unit.carried_out == [plan]


def test_a_line_that_is_opened_again_does_not_disturb_the_unit() -> None:
    unit = ModelUnit(SERIAL)
    rig = Rig(unit, SWEEPING)
    rig.run(2.0)
    rig.cut(5.0)
    rig.link.connected(rig.now_s)
    events = rig.run(2.0)
    assert [event.rebooted for event in of_type(events, Identified)] == [False]
    assert unit.carried_out == [PLAN, frames.Start(0, 250)]


def test_a_unit_that_somebody_else_has_stopped_is_set_up_again() -> None:
    unit = ModelUnit(SERIAL)
    rig = Rig(unit, SWEEPING)
    rig.run(2.0)
    ticket = rig.link.order(frames.Home(0))
    rig.events += rig.link.connected(rig.now_s, "the unit is being updated")
    assert "being updated" in str(rig.settled(ticket).error)
    unit.receive(encode(frames.Stop(1)), rig.now_s)  # as an update does that then fails
    unit.output(rig.now_s)
    rig.link.set_up_again()
    rig.link.connected(rig.now_s)
    unit.carried_out.clear()
    rig.run(2.0)
    assert unit.carried_out == [PLAN, frames.Start(0, 250)]


def test_a_line_that_is_opened_again_to_the_same_boot_takes_sweeps_after_one_clock_exchange() -> None:
    unit = ModelUnit(SERIAL)
    rig = Rig(unit)
    rig.run(2.0)
    rig.cut(5.0)
    rig.link.connected(rig.now_s)
    kinds = [type(event) for event in rig.run(0.3)]
    assert kinds == [Identified, ClockRead, SettingsRead, StatusRead, ClockRead]


def test_a_unit_that_was_given_power_under_the_same_boot_number_is_told_by_its_ticks() -> None:
    unit = ModelUnit(SERIAL)
    rig = Rig(unit, SWEEPING)
    rig.run(20.0)
    rig.cut(5.0)
    restarted = ModelUnit(SERIAL, born_s=rig.now_s)  # as a simulated one is whose flash is not kept
    restarted.make_sweep(rig.now_s)
    rig.unit = restarted
    rig.link.connected(rig.now_s)
    events = rig.run(3.0)
    assert [event.rebooted for event in of_type(events, Identified)] == [False, True]
    rebooted = [type(event) for event in events].index(Identified, 1)
    assert not of_type(events[:rebooted], SweepRead)
    assert restarted.carried_out == [PLAN, frames.Start(0, 250)]


def test_a_plan_that_the_unit_refuses_is_told_and_nothing_is_started() -> None:
    unit = ModelUnit(SERIAL)
    rig = Rig(unit, replace(SWEEPING, plan=replace(PLAN, count=65)))
    rig.run(3.0)
    assert "out of range" in rig.link.setup_error
    assert unit.carried_out == []


def test_a_wrong_serial_is_refused_and_the_unit_is_not_obeyed() -> None:
    unit = ModelUnit(serial=8)
    unit.make_sweep(50.0)
    rig = Rig(unit, SWEEPING)
    events = rig.run(20.0)
    assert {type(event) for event in events} == {Refused}
    assert "unit 8 answers where the site file has 7" in str(of_type(events, Refused)[0].error)
    assert rig.committed == []
    assert unit.carried_out == []
    with pytest.raises(CommandError, match="not connected"):
        rig.link.order(frames.Stop(0))


def test_another_protocol_is_refused() -> None:
    link = Link(SERIAL, AT_REST, 0)
    link.connected(0.0)
    request = link.output(0.0)
    assert request
    answer = frames.Hello(1, 4, SERIAL, 0, 1, 0, 1, 0, 0, 3000)
    (event,) = link.receive(encode(answer), 0.01)
    assert isinstance(event, Refused)
    assert "protocol 4" in str(event.error)


def test_a_unit_that_stops_answering_is_reported_silent_and_greeted_until_it_is_back() -> None:
    rig = Rig(ModelUnit(SERIAL))
    rig.run(2.0)
    ticket = rig.link.order(frames.Single(0))
    events = rig.cut(SILENT_AFTER * TIMEOUT_S + 1.0)
    assert len(of_type(events, Silent)) == 1
    assert "stopped answering" in str(rig.settled(ticket).error)
    assert len(of_type(rig.run(3.0), Identified)) == 1


def test_a_unit_of_which_only_garbage_comes_is_silent_too_but_not_so_soon() -> None:
    rig = Rig(ModelUnit(SERIAL))
    rig.run(2.0)
    silent = []
    for _ in range(GARBLED_AFTER + 2):
        silent.append(bool(of_type(rig.cut(TIMEOUT_S), Silent)))
        rig.link.receive(b"\x05garbage\x00", rig.now_s)
    assert silent.index(True) == pytest.approx(GARBLED_AFTER, abs=1)
    assert silent.count(True) == 1


def test_what_can_not_be_read_has_the_last_acknowledgement_sent_again() -> None:
    rig, unit = with_lost_acknowledgement()
    rig.link.receive(b"\x05garbage\x00", rig.now_s)
    unit.receive(rig.link.output(rig.now_s), rig.now_s)
    assert not unit.ring


def test_an_order_to_reset_is_carried_out_once_the_unit_shows_that_it_was_reset() -> None:
    class Hasty(ModelUnit):
        """Resets before its answer has gone out."""

        def _obey(self, order: frames.Order, now_s: float) -> frames.Frame:
            if isinstance(order, frames.Reset):
                self.reset(now_s, note=1)
                return self._hello(0)
            return super()._obey(order, now_s)

    rig = Rig(Hasty(SERIAL))
    rig.run(1.0)
    ticket = rig.link.order(frames.Reset(0))
    later = rig.link.order(frames.Home(0))
    rig.run(3.0)
    assert rig.settled(ticket).error is None
    assert "was reset" in str(rig.settled(later).error)


def test_a_unit_in_its_loader_is_told_and_asked_nothing_but_hello_now_and_again() -> None:
    unit = ModelUnit(SERIAL)
    unit.in_loader = frames.Stay.NO_APPLICATION
    rig = Rig(unit, SWEEPING)
    events = rig.run(20.0)
    assert {type(event) for event in events} == {InLoader}
    assert {type(frame) for frame in unit.heard} == {frames.AskHello}
    assert len(unit.heard) == pytest.approx(20.0 / LOADER_RETRY_S, abs=1)
    with pytest.raises(CommandError, match="not connected"):
        rig.link.order(frames.Stop(0))


def test_a_unit_that_goes_into_its_loader_is_left_alone_and_greeted_again_when_its_application_is_back() -> None:
    unit = ModelUnit(SERIAL)
    rig = Rig(unit, SWEEPING)
    rig.run(2.0)
    unit.in_loader = frames.Stay.ASKED
    unit.say_loader()
    ticket = rig.link.order(frames.Stop(0))
    assert len(of_type(rig.run(1.0), InLoader)) == 1
    assert "loader" in str(rig.settled(ticket).error)
    unit.in_loader = None
    unit.reset(rig.now_s)
    unit.carried_out.clear()
    events = rig.run(LOADER_RETRY_S + 2.0)
    assert [event.rebooted for event in of_type(events, Identified)] == [True]
    assert unit.carried_out == [PLAN, frames.Start(0, 250)]


def test_another_units_loader_is_refused() -> None:
    unit = ModelUnit(serial=8)
    unit.in_loader = frames.Stay.NOT_CONFIRMED
    (event, *_) = Rig(unit).run(1.0)
    assert isinstance(event, Refused)
    assert "unit 8 answers where the site file has 7" in str(event.error)


def test_an_order_that_is_never_answered_is_repeated_and_then_given_up() -> None:
    class Deaf(ModelUnit):
        def _obey(self, order: frames.Order, now_s: float) -> frames.Frame:  # noqa: ARG002
            return frames.Rejected(2, order.TYPE)

    rig = Rig(Deaf(SERIAL))
    rig.run(1.0)
    ticket = rig.link.order(frames.Home(0))
    rig.run(ORDER_ATTEMPTS * TIMEOUT_S + 1.0)
    assert "did not answer" in str(rig.settled(ticket).error)


def test_what_a_unit_answers_to_an_order_is_told_in_words() -> None:
    unit = ModelUnit(SERIAL)
    rig = Rig(unit, SWEEPING)
    rig.run(1.0)
    ticket = rig.link.order(OWN_PLAN)
    rig.run(0.5)
    assert "busy" in str(rig.settled(ticket).error)


def test_a_clock_exchange_brackets_the_units_stamps_with_the_bytes_own_time_taken_out() -> None:
    link = Link(SERIAL, AT_REST, 0)
    link.connected(0.0)
    link.output(0.0)
    link.receive(encode(frames.Hello(1, 2, SERIAL, 0, 1, 0, 1, 0, 0, 3000)), 1.0)
    assert len(link.output(1.0)) == 8
    (event,) = of_type(link.receive(encode(frames.Clock(2, 4_000_000, 4_000_400)), 1.01), ClockRead)
    # CLOCK is type, request, 4 bytes of CRC, 1 of COBS and the 0x00; its answer has two times of 6 bytes more.
    # A byte is 10 bits at 115200 bit/s.
    assert event.exchange.sent_s == pytest.approx(1.0 + 8 * 10 / 115200)
    assert event.exchange.answered_s == pytest.approx(1.01 - 20 * 10 / 115200)


@pytest.mark.parametrize(("firmware_0_5", "asked"), [(True, 1), (False, 0)])
def test_what_a_unit_has_found_out_before_is_read_once_whatever_number_it_has(firmware_0_5: bool, asked: int) -> None:
    rig = Rig(ModelUnit(knows_turns=firmware_0_5))
    rig.run(5.0)
    assert len(of_type(rig.events, MechanicsRead)) == asked
