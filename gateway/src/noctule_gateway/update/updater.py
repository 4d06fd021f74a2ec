"""The update of one unit, without I/O and without a clock: bytes and times go in, bytes and progress come out."""

from math import inf

from noctule_gateway.errors import GatewayError, LineError, UnitGoneError
from noctule_gateway.update.image import Image
from noctule_gateway.update.outcome import Ending, Progress
from noctule_gateway.update.steps import Answer, Attempt, RestartedError, Steps
from noctule_gateway.wire.codec import FrameReader, encode
from noctule_gateway.wire.frames import AskHello, Frame, Hello, Loader, Rejected, Result, Stop, Update

GONE_AFTER_S = 20.0  # longer than a unit copies, or fails to start eight times
REST_S = 0.02  # for what is still on its way to go by, before what was not understood is sent again

_UNREADABLE = 1  # REJECTED's reason


class Updater:
    """Takes unit ``serial`` to ``image``, as the Talker of its line; see there for its methods.

    ``outcome`` is None until the update has ended. A unit that has the image's version is left alone unless ``again``.
    ``first_request`` should differ from one run to the next.
    """

    def __init__(self, serial: int, image: Image, again: bool, first_request: int) -> None:
        self.outcome: Ending | None = None
        self.image = image
        self._steps = Steps(serial, image, again, first_request)
        self._talk = self._steps.talk()
        self._reader = FrameReader()
        self._out = bytearray()
        self._attempt: Attempt | None = None  # under way
        self._due_s = inf
        self._heard_s: float | None = None
        self._opened_s: float | None = None
        self._cut = ""

    @property
    def progress(self) -> Progress:
        """How far it is."""
        return Progress(self._steps.step, len(self._steps.held), len(self.image.pages))

    @property
    def next_s(self) -> float:
        """When advance() is due, if nothing happens before."""
        return min(self._due_s, self._gone_s)

    def opened(self, now_s: float) -> None:
        """The line is open, or open again."""
        self._reader.reset()
        self._out.clear()
        self._cut = ""
        if self.outcome is not None:
            return
        if self._opened_s is None:
            self._opened_s = now_s
            self._go_on(None, now_s)
        else:
            self._restart(now_s)

    def closed(self, error: LineError, now_s: float) -> None:  # noqa: ARG002
        """The line was cut, or can't be opened; before anything was heard of the unit, that is the end."""
        self._cut = f" ({error})"
        self._attempt, self._due_s = None, inf
        if self.outcome is None and self._heard_s is None:
            self._end(error)

    def receive(self, data: bytes, now_s: float) -> None:
        """Take in what came over the line."""
        for frame in self._reader.feed(data):
            self._heard_s = now_s
            if self.outcome is None:
                self._take(frame, now_s)

    def advance(self, now_s: float) -> None:
        """Take in that time has passed."""
        if self.outcome is not None:
            return
        if now_s >= self._gone_s:
            self._end(self._gone())
        elif now_s >= self._due_s:
            self._go_on(None, now_s)

    def output(self, now_s: float) -> bytes:  # noqa: ARG002
        """What to write to the line, at once."""
        written = bytes(self._out)
        self._out.clear()
        return written

    @property
    def _gone_s(self) -> float:
        last_s = self._heard_s if self._heard_s is not None else self._opened_s
        return inf if last_s is None or self.outcome is not None else last_s + GONE_AFTER_S

    def _gone(self) -> UnitGoneError:
        if self._heard_s is None:
            return UnitGoneError(
                "no unit answers: check supply and cable; firmware before 0.2 has no loader and needs a programmer"
            )
        return UnitGoneError(
            f"the unit has not answered for {GONE_AFTER_S:.0f} s while {self._steps.step.value}{self._cut}: "
            "check supply and cable and update it again, it goes on where it was"
        )

    def _take(self, frame: Frame, now_s: float) -> None:
        asked = self._attempt.asked if self._attempt else None
        sent = self._attempt.frame if self._attempt else None
        match frame:
            case Hello() | Loader() if frame.request == 0:
                self._overhear(frame, now_s)
            case Hello() | Loader() if isinstance(asked, AskHello) and frame.request == asked.request:
                self._go_on(frame, now_s)
            case Result() if asked is not None and (frame.request, frame.command) == (asked.request, asked.TYPE):
                self._go_on(frame, now_s)
            case Rejected(reason=reason, type=kind) if sent is not None:
                if reason == _UNREADABLE:
                    self._hasten(now_s)
                elif kind == sent.TYPE:  # a FOR is rejected as such, whatever is in it
                    self._restart(now_s)  # the application knows no loader's frames, nor the loader its

    def _overhear(self, frame: Hello | Loader, now_s: float) -> None:
        """What a unit says without being asked: it has started, or is in its loader and waits."""
        asked = self._attempt.asked if self._attempt else None
        for_loader = asked is not None and not isinstance(asked, AskHello | Stop | Update)
        if isinstance(asked, AskHello) or (for_loader and isinstance(frame, Loader)):
            self._hasten(now_s)
        else:
            self._restart(now_s)

    def _hasten(self, now_s: float) -> None:
        """The answer will not come: there is no need to wait for its time-out."""
        self._due_s = min(self._due_s, now_s + REST_S)

    def _restart(self, now_s: float) -> None:
        try:
            self._begin(self._talk.throw(RestartedError()), now_s)
        except StopIteration as end:
            self._end(end.value)
        except GatewayError as error:
            self._end(error)

    def _go_on(self, answer: Answer | None, now_s: float) -> None:
        try:
            self._begin(self._talk.send(answer), now_s)
        except StopIteration as end:
            self._end(end.value)
        except GatewayError as error:
            self._end(error)

    def _begin(self, attempt: Attempt, now_s: float) -> None:
        self._attempt = attempt
        self._due_s = now_s + attempt.within_s
        if attempt.frame is not None:
            self._out += encode(attempt.frame)

    def _end(self, outcome: Ending) -> None:
        self.outcome = outcome
        self._attempt, self._due_s = None, inf
