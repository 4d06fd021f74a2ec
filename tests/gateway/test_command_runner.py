"""Commands of the bus that come close upon one another, carried out by a unit that speaks the protocol."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace

from gateway.model_unit import OWN_PLAN, ModelUnit

from noctule.messages_pb2 import CommandReply, CommandRequest, SweepPlan, UnitStatus
from noctule_gateway.link.events import MechanicsRead, OrderSettled, SettingsRead, StatusRead
from noctule_gateway.link.link import Link
from noctule_gateway.link.standing_orders import Wanted
from noctule_gateway.unit.command_runner import CommandRunner
from noctule_gateway.update.admission import Admission
from noctule_gateway.wire import frames

STEP_S = 0.002
AT_REST = Wanted(plan=None, start=frames.Start(0, 0), running=False)
PLAN = replace(OWN_PLAN, ping_interval_ms=80)
FIVE = CommandRequest(request_id="a", plan=SweepPlan(count=5))
MEDIAN = CommandRequest(request_id="b", plan=SweepPlan(pings=3))


class Desk:
    """Who gives commands to a unit on a sound line."""

    def __init__(
        self, unit: ModelUnit, wanted: Wanted = AT_REST, status: Callable[[], UnitStatus] = UnitStatus
    ) -> None:
        self.unit = unit
        self.link = Link(unit.serial, wanted, first_request=0)
        self.commands = CommandRunner(
            self.link, status, lambda _image, _again: None, Admission(), lambda done: done(None)
        )
        self.now_s = 100.0
        self.link.connected(self.now_s)

    def command(self, name: str, request: CommandRequest) -> Future[CommandReply]:
        reply: Future[CommandReply] = Future()
        self.commands.begin(name, request, reply)
        return reply

    def run(self, duration_s: float) -> None:
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            self.exchange()

    def exchange(self) -> None:
        self.now_s += STEP_S
        events = self.link.advance(self.now_s)
        self.unit.receive(self.link.output(self.now_s), self.now_s)
        for event in (*events, *self.link.receive(self.unit.output(self.now_s), self.now_s)):
            match event:
                case SettingsRead():
                    self.commands.settings_read()
                case OrderSettled():
                    self.commands.settled(event)
                case StatusRead(status):
                    self.commands.status_read(status)
                case MechanicsRead(mechanics):
                    self.commands.mechanics_read(mechanics)


def test_the_second_of_two_plans_given_in_part_leaves_what_the_first_has_changed() -> None:
    desk = Desk(ModelUnit())
    desk.run(1.0)
    replies = [desk.command("configure", each) for each in (FIVE, MEDIAN)]
    desk.run(1.0)
    assert all(reply.result(0).done for reply in replies)
    assert replace(desk.unit.plan, request=0) == replace(OWN_PLAN, count=5, pings=3)


def test_a_plan_that_waits_for_one_that_is_refused_is_carried_out_all_the_same() -> None:
    desk = Desk(ModelUnit())
    desk.run(1.0)
    refused = desk.command("configure", CommandRequest(plan=SweepPlan(count=65)))
    reply = desk.command("configure", MEDIAN)
    desk.run(1.0)
    assert "out of range" in refused.result(0).error
    assert reply.result(0).done
    assert replace(desk.unit.plan, request=0) == replace(OWN_PLAN, pings=3)


def test_a_plan_that_waits_for_one_that_is_never_answered_is_carried_out_all_the_same() -> None:
    class Absent(ModelUnit):
        """Does not answer a plan of five readings, and does not take it."""

        def _obey(self, order: frames.Order, now_s: float) -> frames.Frame:
            if isinstance(order, frames.Configure) and order.count == 5:
                return frames.Rejected(2, order.TYPE)
            return super()._obey(order, now_s)

    desk = Desk(Absent())
    desk.run(1.0)
    unanswered, reply = (desk.command("configure", each) for each in (FIVE, MEDIAN))
    desk.run(10.0)
    assert "did not answer" in unanswered.result(0).error
    assert reply.result(0).done


def test_a_plan_given_in_part_before_the_site_files_plan_has_reached_the_unit_is_over_that_one() -> None:
    desk = Desk(ModelUnit(), replace(AT_REST, plan=PLAN))
    while not desk.link.identified:
        desk.exchange()
    reply = desk.command("configure", FIVE)
    desk.run(1.0)
    assert reply.result(0).done
    assert replace(desk.unit.plan, request=0) == replace(PLAN, count=5)


def test_a_start_before_the_site_files_plan_has_reached_the_unit_does_not_keep_the_plan_from_it() -> None:
    class Slow(ModelUnit):
        """Is busy at first, as one that comes to rest."""

        def _obey(self, order: frames.Order, now_s: float) -> frames.Frame:
            if isinstance(order, frames.Configure) and now_s < 101.0:
                return frames.Result(order.request, order.TYPE, frames.Outcome.BUSY)
            return super()._obey(order, now_s)

    desk = Desk(Slow(), replace(AT_REST, plan=PLAN))
    desk.run(0.7)
    reply = desk.command("start", CommandRequest(request_id="a", pause_s=0.25))
    desk.run(3.0)
    assert reply.result(0).done
    assert desk.unit.plan.ping_interval_ms == PLAN.ping_interval_ms
    assert desk.unit.carried_out[-1] == frames.Start(0, 250)
