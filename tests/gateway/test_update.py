"""The updater: against the real firmware in a time of the test's own, and against what a unit should never say."""

from collections.abc import Callable
from dataclasses import replace
from itertools import groupby
from typing import Any

import pytest
from firmware.images import VERSION, built_with_fault, newer_version, with_flash
from firmware.stepped_unit import IMAGE, SteppedUnit, stepped_unit
from firmware.update_rig import staged
from gateway.bad_line import BadLine, Faults

from noctule_gateway.errors import HardwareError, LineError, UnitGoneError, UpdateError, WrongUnitError
from noctule_gateway.update.admission import Admission
from noctule_gateway.update.image import Image
from noctule_gateway.update.outcome import Current, Step, Updated
from noctule_gateway.update.steps import BUSY_RETRIES, BUSY_RETRY_S, FRUITLESS
from noctule_gateway.update.updater import GONE_AFTER_S, Updater
from noctule_gateway.wire.codec import FrameReader, encode
from noctule_gateway.wire.frames import (
    Ack,
    Ack2,
    AnySweep,
    AskHello,
    For,
    Hello,
    Install,
    Loader,
    Outcome,
    Put,
    Rejected,
    Result,
    Stay,
    Stop,
)
from noctule_gateway.wire.frames import Update as EnterLoader

SERIAL = 1
STEP_S = 0.005
UNKNOWN_TYPE = 2  # REJECTED's reason: firmware/README.md
HELLO = Hello(0, 2, SERIAL, 0, 2, 0, 1, 0x02, 0, 3048)
NAMED = replace(HELLO, protocol=3, life=77)  # knows orders that name their unit
LOADER = Loader(0, 2, SERIAL, 1, 1, Stay.ASKED, 0, 2, 0)


@pytest.fixture(scope="module")
def image(tmp_path_factory) -> Image:
    """The update to version 0.9.0."""
    return Admission(takes_unsigned=True).load(newer_version(tmp_path_factory.mktemp("newer")))


@pytest.fixture(scope="module")
def dead(tmp_path_factory) -> Image:
    """An image that stands still before it has started its watchdog."""
    standing = ("    stack_start();\n", "    while (reset_note() != 99)\n        ;\n    stack_start();\n")
    return Admission(takes_unsigned=True).load(
        built_with_fault(tmp_path_factory.mktemp("dead"), "src/main.c", standing).with_name("update.hex")
    )


class Rig:
    """An updater and a stepped unit on one line."""

    def __init__(
        self, unit: SteppedUnit, image: Image, again: bool = False, faults: Faults | None = None, seed: int = 1
    ) -> None:
        self.unit = unit
        self.updater = Updater(SERIAL, image, again, first_request=250)
        self.sent = FrameReader()  # what the updater has sent, read again
        self.puts = 0
        self._down, self._up = BadLine(faults or Faults(), seed), BadLine(faults or Faults(), seed + 1000)
        self.updater.opened(unit.now_s)

    def run(self, until: Callable[[], bool] = lambda: False) -> "Rig":
        """Until the update has ended, or until then."""
        while self.updater.outcome is None and not until():
            self.exchange()
        return self

    def exchange(self) -> None:
        now_s = self.unit.now_s
        self.updater.advance(now_s)
        written = self.updater.output(now_s)
        self.puts += sum(isinstance(frame, Put) for frame in self.sent.feed(written))
        self._down.write(written, now_s)
        self._up.write(self.unit.step(feed=[self._down.read(now_s).hex()], until_s=now_s + STEP_S), now_s + STEP_S)
        self.updater.receive(self._up.read(self.unit.now_s), self.unit.now_s)


# ---- The real firmware -------------------------------------------------------------------------------


# A PUT of 128 bytes is 142 bytes on the line: about one in two is hit, as is one in twenty of the RESULTs of 10 bytes.
@pytest.mark.parametrize("seed", range(2))
def test_an_update_gets_over_a_line_that_spoils_loses_and_doubles_bytes_and_delays_them(image, seed):
    with stepped_unit("--laps", "0") as unit:
        faults = Faults(corrupted=0.002, lost=0.002, doubled=0.001, delay_s=0.01)
        rig = Rig(unit, image, faults=faults, seed=seed).run()
        assert rig.updater.outcome == Updated(VERSION)


def test_an_update_gets_over_a_line_whose_answers_take_a_quarter_of_a_second(image, tmp_path):
    # Staging holds the image, so that only its description is sent: it takes long enough.
    with stepped_unit("--laps", "0", image=with_flash(IMAGE, staged(image), tmp_path / "staged.hex")) as unit:
        assert Rig(unit, image, faults=Faults(delay_s=0.25)).run().updater.outcome == Updated(VERSION)


def test_progress_is_told_step_by_step_and_page_by_page(image):
    with stepped_unit("--laps", "0") as unit:
        rig = Rig(unit, image)
        told = [rig.updater.progress]
        while rig.updater.outcome is None:
            rig.exchange()
            if rig.updater.progress != told[-1]:
                told.append(rig.updater.progress)
        assert [step for step, _ in groupby(each.step for each in told)] == [*Step]
        assert [each.pages for each in told] == sorted(each.pages for each in told)
        assert told[-1].pages == told[-1].of_pages == len(image.pages)


def test_what_a_cut_off_update_has_sent_is_not_sent_again(image):
    with stepped_unit("--laps", "0") as unit:
        first = Rig(unit, image)
        first.run(until=lambda: first.updater.progress.pages == 30)
        assert first.puts >= 30 * 4
        unit.inject("power_cut", for_s=0.2)
        second = Rig(unit, image).run()
        assert second.updater.outcome == Updated(VERSION)
        assert second.puts == (len(image.pages) - 30) * 4


def test_a_line_that_is_cut_and_opened_again_does_not_end_an_update(image):
    with stepped_unit("--laps", "0") as unit:
        rig = Rig(unit, image)
        for pages in (5, 20, 41):
            rig.run(until=lambda pages=pages: rig.updater.progress.pages == pages)
            rig.updater.closed(LineError("pulled out"), unit.now_s)
            unit.run(3.0)
            rig.updater.opened(unit.now_s)
        assert rig.run().updater.outcome == Updated(VERSION)


def test_a_unit_that_loses_its_supply_is_given_up_with_a_word_on_how_to_go_on(image):
    with stepped_unit("--laps", "0") as unit:
        rig = Rig(unit, image)
        rig.run(until=lambda: rig.updater.progress.pages == 5)
        unit.inject("power_cut", for_s=1000)
        rig.run()
        assert isinstance(rig.updater.outcome, UnitGoneError)
        assert "while sending" in str(rig.updater.outcome) and "goes on where it was" in str(rig.updater.outcome)


def test_a_unit_that_does_not_come_back_with_its_image_is_told(dead):
    with stepped_unit("--laps", "0") as unit:
        outcome = Rig(unit, dead, again=True).run().updater.outcome
        assert isinstance(outcome, UnitGoneError)
        assert "while starting" in str(outcome)


def test_a_dead_image_gives_way_to_a_good_one_after_eight_power_ups(dead, image):
    with stepped_unit("--laps", "0") as unit:
        Rig(unit, dead, again=True).run()
        for _ in range(7):  # the first start was the update's
            unit.inject("power_cut", for_s=0.2)
            assert unit.run(2.0) == b""
        unit.inject("power_cut", for_s=0.2)
        assert unit.receive(Loader).reason == Stay.NOT_CONFIRMED
        assert Rig(unit, image).run().updater.outcome == Updated(VERSION)


# ---- What is said to it ------------------------------------------------------------------------------


class Script:
    """A unit that answers at once what the test says, or nothing; runs until the update has ended."""

    def __init__(self, image: Image, answer: Callable[[Any], Any]) -> None:
        updater = Updater(SERIAL, image, again=False, first_request=0)
        reader = FrameReader()
        self.now_s = 0.0
        updater.opened(self.now_s)
        while updater.outcome is None:
            updater.advance(self.now_s)
            while asked := reader.feed(updater.output(self.now_s)):
                for frame in asked:
                    assert not isinstance(frame, Ack | Ack2 | Rejected | AnySweep)
                    request = frame.order.request if isinstance(frame, For) else frame.request
                    if (said := answer(frame)) is not None:
                        numbered = said if isinstance(said, Rejected) else replace(said, request=request)
                        updater.receive(encode(numbered), self.now_s)
            self.now_s = min(updater.next_s, self.now_s + 1.0)
        self.outcome = updater.outcome


def test_a_unit_that_has_the_version_is_asked_no_more_than_that(image):
    asked = []
    script = Script(image, lambda frame: asked.append(frame) or replace(HELLO, version_minor=9))
    assert script.outcome == Current()
    assert len(asked) == 1


@pytest.mark.parametrize("who", [replace(HELLO, serial=8), replace(LOADER, serial=8)])
def test_another_unit_is_not_updated(image, who):
    outcome = Script(image, lambda _: who).outcome
    assert isinstance(outcome, WrongUnitError)
    assert "unit 8 answers where the site file has 1" in str(outcome)


def test_orders_before_the_loader_name_the_unit_that_they_are_for(image):
    orders = []

    def exchanged(frame):
        if isinstance(frame, AskHello):
            return NAMED
        orders.append(frame)
        (kind, outcome) = (Stop, Outcome.DONE) if len(orders) == 1 else (EnterLoader, Outcome.NOT_FOR_THIS_UNIT)
        return Result(0, kind.TYPE, outcome)

    outcome = Script(image, exchanged).outcome
    assert isinstance(outcome, WrongUnitError) and "says that it is not 1" in str(outcome)
    stop, update = orders
    assert stop == For(SERIAL, 77, Stop(stop.order.request))
    assert update == For(SERIAL, 77, EnterLoader(update.order.request, SERIAL))


def test_a_loader_that_knows_no_addressed_orders_is_greeted_when_the_answer_to_update_was_lost(image):
    """Else the order is repeated until no attempt is left: 10 s in which the loader waits in silence."""
    asked = []

    def in_its_loader_after_update(frame):
        asked.append(frame)
        match frame:
            case AskHello():
                return NAMED if len(asked) == 1 else replace(LOADER, hardware=2)  # an end, as soon as it is met
            case For(order=Stop()):
                return Result(0, Stop.TYPE, Outcome.DONE)
        return Rejected(UNKNOWN_TYPE, frame.TYPE)  # firmware/loader/serve.c, length_reason() and reject()

    assert isinstance(Script(image, in_its_loader_after_update).outcome, HardwareError)
    assert [type(frame) for frame in asked] == [AskHello, For, For, AskHello]


def test_nothing_is_installed_on_another_unit_whose_plug_was_put_in_while_pages_were_sent(image):
    asked = []

    def exchanged(frame):
        asked.append(frame)
        if isinstance(frame, AskHello):
            return LOADER if len(asked) == 1 else replace(LOADER, serial=8)
        return Result(0, frame.TYPE, Outcome.DONE)

    outcome = Script(image, exchanged).outcome
    assert isinstance(outcome, WrongUnitError) and "unit 8 answers where the site file has 1" in str(outcome)
    assert not any(isinstance(frame, Install) for frame in asked)


def test_another_protocol_is_refused(image):
    assert isinstance(Script(image, lambda _: replace(HELLO, protocol=4)).outcome, WrongUnitError)


def test_an_image_for_other_hardware_is_not_sent(image):
    outcome = Script(image, lambda _: replace(LOADER, hardware=2)).outcome
    assert isinstance(outcome, HardwareError)
    assert "the image is for hardware 1, the unit is hardware 2" in str(outcome)


def test_a_unit_that_never_rests_is_told(image):
    def sweeping(frame):
        match frame:
            case Stop():
                return Result(0, frame.TYPE, Outcome.DONE)
            case EnterLoader():
                return Result(0, frame.TYPE, Outcome.BUSY)
        return HELLO

    script = Script(image, sweeping)
    assert isinstance(script.outcome, UpdateError) and "did not come to rest" in str(script.outcome)
    assert script.now_s == pytest.approx(BUSY_RETRIES * BUSY_RETRY_S, abs=1.0)


def test_a_unit_that_always_comes_back_as_it_was_is_given_up(image):
    greeted = []

    def forgetful(frame):
        if isinstance(frame, (Stop, EnterLoader)):
            return Result(0, frame.TYPE, Outcome.DONE)
        greeted.append(frame)
        return HELLO

    outcome = Script(image, forgetful).outcome
    assert isinstance(outcome, UnitGoneError) and "got no further than into the loader" in str(outcome)
    assert len(greeted) == FRUITLESS


def test_silence_from_the_beginning_is_told(image):
    script = Script(image, lambda _: None)
    assert isinstance(script.outcome, UnitGoneError) and "no unit answers" in str(script.outcome)
    assert script.now_s == pytest.approx(GONE_AFTER_S, abs=1.0)


def test_a_line_that_can_not_be_opened_is_the_end(image):
    updater = Updater(SERIAL, image, again=False, first_request=0)
    updater.closed(LineError("can't open /dev/ttyUSB0: busy"), 0.0)
    assert isinstance(updater.outcome, LineError)
    assert "busy" in str(updater.outcome)


def test_a_line_that_is_cut_and_opened_again_after_the_end_changes_nothing(image):
    updater = Updater(SERIAL, image, again=False, first_request=0)
    updater.opened(0.0)
    (asked,) = FrameReader().feed(updater.output(0.0))
    assert isinstance(asked, AskHello)
    updater.receive(encode(replace(HELLO, version_minor=9, request=asked.request)), 0.1)
    updater.closed(LineError("pulled out"), 1.0)
    updater.opened(2.0)
    assert updater.outcome == Current()
    assert updater.output(2.0) == b""
