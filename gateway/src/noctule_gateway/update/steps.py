"""How a unit is updated, as a conversation: what is sent, and what each answer leads to.

However the unit is met, it is greeted first, and what it says decides: an application of another version is sent into
its loader, a loader gets the pages that it does not hold yet, installs them and starts them, and an application of the
image's version is the end. So whatever cuts an update off, greeting the unit again resumes it.
"""

import zlib
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import TypeVar

from noctule_gateway.errors import FlashError, HardwareError, UnitGoneError, UpdateError, WrongUnitError
from noctule_gateway.link.peer import mismatch
from noctule_gateway.link.voucher import addressee_of
from noctule_gateway.update.blocks import BlockSize
from noctule_gateway.update.image import PAGES, Image
from noctule_gateway.update.outcome import Current, Step, Updated
from noctule_gateway.wire.frames import (
    MAX_REQUEST,
    AskHello,
    For,
    Hello,
    Install,
    Loader,
    Order,
    Outcome,
    Program,
    Put,
    Result,
    Run,
    Stay,
    Stop,
    Update,
)

TIMEOUT_S = 0.1  # a loader answers within 20 ms, PROGRAM and RUN within 80
LONG_TIMEOUT_S = 0.5  # every so many attempts, for lines that take their time
LONG_EVERY = 4
INSTALL_TIMEOUT_S = 8.0  # 56 pages at the datasheet's longest times are 3.4 s, two looks at 28 KB one more
BUSY_RETRY_S = 0.5
BUSY_RETRIES = 120
ATTEMPTS = 50  # where one byte in twenty is spoiled, one in seven gets through
PUT_ROUNDS = 10  # of a page
FLASH_ATTEMPTS = 3
FRUITLESS = 20  # greetings, and not a page between them

_NONE = 0xFF  # each number of the version, where there is no application

Asked = AskHello | Stop | Update | Put | Program | Install | Run
Answer = Hello | Loader | Result
_T = TypeVar("_T")


@dataclass(frozen=True)
class Attempt:
    """What is asked once, how long its answer is awaited, and the frame to send: ``asked``, or For around it.

    Without ``asked`` it is a rest.
    """

    asked: Asked | None
    within_s: float
    frame: Asked | For | None


Talk = Generator[Attempt, Answer | None, _T]


class RestartedError(Exception):
    """The unit is not where it was: it must be greeted again."""


class Steps:
    """The update of unit ``serial`` to ``image``; one that has its version already is left alone unless ``again``."""

    def __init__(self, serial: int, image: Image, again: bool, first_request: int) -> None:
        self.step = Step.GREETING
        self.held: set[int] = set()  # pages that staging is known to hold
        self._serial, self._image, self._again = serial, image, again
        self._number = first_request % MAX_REQUEST
        self._addressee: tuple[int, int] | None = None
        self._before: str | None = None
        self._met = self._entered = self._installed = False
        self._fruitless = 0
        self._blocks = BlockSize()

    def talk(self) -> Talk[Updated | Current]:
        """The whole conversation. RestartedError may be thrown in at any time; raises what ends the update."""
        while self._fruitless < FRUITLESS:
            self._fruitless += 1
            try:
                met = yield from self._greet()
                if isinstance(met, Loader):
                    yield from self._load(met)
                elif self._is_done(met):
                    return Updated(self._before) if self._entered else Current()
                else:
                    yield from self._enter()
            except RestartedError:
                continue
        raise UnitGoneError(f"the unit was met {FRUITLESS} times and got no further than {self.step.value}: try again")

    # ---- Greeting ------------------------------------------------------------------------------

    def _greet(self) -> Talk[Hello | Loader]:
        answer = yield from self._ask(AskHello(0))
        assert isinstance(answer, Hello | Loader)
        error = mismatch(answer, self._serial)
        if error is not None:
            raise error
        self._addressee = addressee_of(answer) if isinstance(answer, Hello) else None
        if not self._met:
            self._met = True
            self._before = _version(answer)
        return answer

    def _is_done(self, hello: Hello) -> bool:
        if hello.version == self._image.version_text:
            return self._installed or not self._again
        if self._installed:
            raise UpdateError(f"the unit runs {hello.version} after all: is the image's description its own?")
        return False

    def _enter(self) -> Talk[None]:
        """Bring the unit to rest and into its loader."""
        self.step = Step.ENTERING
        if (yield from self._order(Stop(0))) == Outcome.NOT_FOR_THIS_UNIT:
            raise _another_unit(self._serial)
        for _ in range(BUSY_RETRIES):
            match (yield from self._order(Update(0, self._serial))):
                case Outcome.DONE:
                    self._entered = True
                    return
                case Outcome.BUSY:
                    yield Attempt(None, BUSY_RETRY_S, None)
                case Outcome.NOT_FOR_THIS_UNIT:
                    raise _another_unit(self._serial)
                case result:
                    raise UpdateError(f"the unit answers UPDATE with result {result}")
        raise UpdateError(f"the unit did not come to rest within {BUSY_RETRIES * BUSY_RETRY_S:.0f} s: stop it first")

    # ---- Loading -------------------------------------------------------------------------------

    def _load(self, loader: Loader) -> Talk[None]:
        self._entered = True
        if loader.hardware != self._image.hardware:
            raise _other_hardware(self._image, loader.hardware)
        if self._installed and loader.reason == Stay.NOT_CONFIRMED:
            raise UpdateError(
                f"{self._image.version_text} does not start: it has not reported in, and the unit waits in its loader. "
                "Update it with an image that works"
            )
        if not self._installed or loader.reason != Stay.ASKED:
            yield from self._install()
        self.step = Step.STARTING
        result = yield from self._order(Run(0))
        if result != Outcome.DONE:
            raise FlashError(f"the loader finds no application that it may start (result {result}): try again")

    def _install(self) -> Talk[None]:
        self._installed = False
        for attempt in range(FLASH_ATTEMPTS):
            self.step = Step.SENDING
            for page, content in self._image.pages.items():
                # A page that ends in its own CRC has the CRC of every such page, so the description is always sent.
                if attempt > 0 or page == PAGES - 1:
                    yield from self._put(content)
                yield from self._program(page, content)
                self._fruitless = 0
            # A loader's orders name no unit, and another unit's plug may have been put in since the greeting.
            if not isinstance((yield from self._greet()), Loader):
                raise RestartedError
            self.step = Step.INSTALLING
            result = yield from self._order(Install(0), INSTALL_TIMEOUT_S)
            if result == Outcome.DONE:
                self._installed = True
                return
            if result == Outcome.NOT_FOR_THIS_UNIT:
                raise HardwareError("the loader says that the image is for other hardware: take the one for this unit")
        raise FlashError(f"the unit's flash does not hold the image (result {result}): try again, or change the chip")

    def _program(self, page: int, content: bytes) -> Talk[None]:
        """Have staging hold ``page``; what it holds already, by its CRC, is not sent."""
        order = Program(0, page, zlib.crc32(content))
        sent = failed = 0
        while (result := (yield from self._order(order))) != Outcome.DONE:
            self.held.discard(page)
            if result == Outcome.BAD_CRC and sent < PUT_ROUNDS:
                sent += 1
                yield from self._put(content)
            elif result == Outcome.FLASH_FAILED and failed < FLASH_ATTEMPTS:
                failed += 1
            else:
                raise FlashError(f"page {page} of the unit's staging does not hold what it was given (result {result})")
        self.held.add(page)

    def _put(self, content: bytes) -> Talk[None]:
        at = 0
        while at < len(content):
            block = self._blocks.cut(content, at)
            result = yield from self._put_block(Put(0, at, block))
            if result is None:
                continue  # in smaller blocks
            if result != Outcome.DONE:
                raise UpdateError(f"the loader refuses bytes {at} to {at + len(block)} of a page (result {result})")
            at += len(block)

    def _put_block(self, put: Put) -> Talk[int | None]:
        """What became of a block; None if it did not get through, and smaller ones are to be tried."""
        numbered = self._numbered(put)
        for attempt in range(ATTEMPTS):
            answer = yield Attempt(numbered, _timeout_s(attempt), numbered)
            if isinstance(answer, Result):
                self._blocks.went_through(at_once=attempt == 0)
                return answer.result
            self._blocks.failed()
            if attempt > 0 and self._blocks.shrink():
                return None
        raise RestartedError

    # ---- Asking --------------------------------------------------------------------------------

    def _order(self, order: Stop | Update | Program | Install | Run, within_s: float = 0.0) -> Talk[int]:
        answer = yield from self._ask(order, within_s)
        assert isinstance(answer, Result)
        return answer.result

    def _ask(self, frame: Asked, within_s: float = 0.0) -> Talk[Answer]:
        """The answer to ``frame``, which is sent again, under its own number, as long as there is none.

        It may need ``within_s``, if that is longer than usual.
        """
        numbered = self._numbered(frame)
        sent = self._addressed(numbered)
        for attempt in range(ATTEMPTS):
            answer = yield Attempt(numbered, max(within_s, _timeout_s(attempt)), sent)
            if answer is not None:
                return answer
        raise RestartedError

    def _numbered(self, frame: Asked) -> Asked:
        self._number = self._number % MAX_REQUEST + 1
        return replace(frame, request=self._number)

    def _addressed(self, frame: Asked) -> Asked | For:
        """An order to an application names the unit; those to a loader can't."""
        if self._addressee is not None and isinstance(frame, Order):
            return For(*self._addressee, frame)
        return frame


def _timeout_s(attempt: int) -> float:
    return LONG_TIMEOUT_S if attempt % LONG_EVERY == LONG_EVERY - 1 else TIMEOUT_S


def _version(met: Hello | Loader) -> str | None:
    if isinstance(met, Hello):
        return met.version
    numbers = (met.application_major, met.application_minor, met.application_patch)
    return None if numbers == (_NONE,) * 3 else ".".join(map(str, numbers))


def _another_unit(serial: int) -> WrongUnitError:
    return WrongUnitError(f"the unit on the line says that it is not {serial}: check cable and address")


def _other_hardware(image: Image, hardware: int) -> HardwareError:
    return HardwareError(
        f"the image is for hardware {image.hardware}, the unit is hardware {hardware}: take the image for this unit"
    )
