"""The link and the real firmware on a sound cable: commands, settings, resets and the loader."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import pi

import pytest
from firmware.stepped_unit import SteppedUnit, stepped_unit
from system.lockstep import CLEAN, Lockstep

from noctule.messages_pb2 import Calibration, CommandRequest, SweepPlan, UnitSettings
from noctule_gateway.link.events import Identified, InLoader
from noctule_gateway.link.link import Link
from noctule_gateway.link.standing_orders import Wanted
from noctule_gateway.wire import orders, settings_message
from noctule_gateway.wire.frames import Start, State, Stay, Update
from noctule_gateway.wire.sweep_message import bearing_rad

AT_REST = Wanted(plan=None, start=Start(0, 0), running=False)
RESET_ORDERED = 1  # reset_note: firmware/README.md, "Unit to host"


class Desk:
    """Who gives the unit commands of the bus."""

    def __init__(self, unit: SteppedUnit) -> None:
        self.link = Link(serial=1, wanted=AT_REST, first_request=0)
        self.cable = Lockstep(unit, self.link, CLEAN, seed=1)
        self.cable.run(2.0)

    def command(self, name: str, request: CommandRequest | None = None) -> None:
        """Have it carried out."""
        request = request or CommandRequest()
        if orders.needs_settings(name):
            assert self.link.settings is not None
            self.cable.carry_out(orders.order_over(name, request, self.link.settings), within_s=5.0)
        else:
            self.cable.carry_out(orders.order(name, request), within_s=5.0)
        self.cable.run(1.0)

    def settings(self) -> UnitSettings:
        """As the link has read them last."""
        assert self.link.settings is not None
        return settings_message.to_message(self.link.settings)


@contextmanager
def desk() -> Iterator[Desk]:
    with stepped_unit("--laps", "0") as unit:
        yield Desk(unit)


def test_a_unit_goes_to_a_bearing_and_says_when_it_is_there() -> None:
    with desk() as at:
        at.command("home")
        at.cable.wait_for(lambda: at.cable.state == State.IDLE, within_s=30.0)
        at.cable.carry_out(orders.order("go_to", CommandRequest(bearing_rad=pi / 3)), within_s=5.0)
        at.cable.wait_for(lambda: at.cable.state == State.TURNING, within_s=5.0)
        at.cable.wait_for(lambda: at.cable.state == State.IDLE, within_s=30.0)
        assert at.cable.tally.status is not None
        # A half step is 0.09 degrees.
        assert bearing_rad(at.cable.tally.status.bearing) == pytest.approx(pi / 3, abs=2 * pi / 4075)


def test_what_was_stored_is_there_after_a_reset_and_what_was_not_is_not() -> None:
    with desk() as at:
        at.command("calibrate", CommandRequest(calibration=Calibration(backlash_half_steps=7)))
        at.command("trim_temperature", CommandRequest(temperature_c=19.5))
        at.command("store")
        stored = at.settings()
        assert (stored.calibration.backlash_half_steps, stored.stored) == (7, True)
        assert stored.HasField("temperature_trim_k")
        at.command("calibrate", CommandRequest(calibration=Calibration(backlash_half_steps=9)))
        assert (at.settings().calibration.backlash_half_steps, at.settings().stored) == (9, False)
        at.command("reset")
        assert at.settings() == stored
        hello = at.cable.tally.of_type(Identified)[-1].hello
        assert hello.reset_note == RESET_ORDERED


def test_an_operators_plan_outlives_a_reset_though_it_was_not_stored() -> None:
    with desk() as at:
        at.command("configure", CommandRequest(plan=SweepPlan(count=5, pings=3)))
        at.command("reset")
        at.cable.run(1.0)
        assert (at.settings().plan.count, at.settings().plan.pings) == (5, 3)


def test_a_unit_that_is_left_in_its_loader_is_shown_and_served_again_when_it_has_left_it_by_itself() -> None:
    with desk() as at:
        at.cable.carry_out(Update(0, serial=1), within_s=5.0)
        at.cable.run(30.0)
        assert {event.loader.reason for event in at.cable.tally.of_type(InLoader)} == {Stay.ASKED}
        assert not at.link.identified
        # With nobody there for 60 s it starts the application: firmware/README.md, "Update".
        at.cable.wait_for(lambda: at.link.identified, within_s=60.0)
        at.command("single")
        at.cable.wait_for(lambda: len(at.cable.tally.arrived) == 1, within_s=60.0)
