"""A scanner unit as firmware/README.md describes it, the far end of the gateway's tests. It reads no clock."""

from collections import deque
from dataclasses import replace

from noctule_gateway.wire import frames
from noctule_gateway.wire.codec import FrameReader, encode
from noctule_gateway.wire.frames import AnySweep, NoEcho, Outcome, Reading, State, Sweep, Sweep2

TICKS_PER_S = 4_000_000
RING_SWEEPS = 24
RESEND_AFTER_S = (0.5, 1.0, 2.0, 4.0)  # "Sweeps are not lost"
STARTED, IN_TURN = 0x02, 0x08
CHIP_TEMPERATURE = 3150  # 0.01 degrees C
OWN_PLAN = frames.Configure(0, -24576, 4096, 13, 60, 600, 100, 20, 1)  # "Host to unit"
OWN_CALIBRATION = frames.Calibrate(0, 1_043_397, 0, frames.HomeKind.SWITCH, -27307)  # 4075.77 half steps, -150 degrees


class ModelUnit:
    """A unit that was powered up at ``born_s`` and whose oscillator is fast by ``drift``; sweeps take ``sweep_s``.

    ``made`` holds every sweep that it has made, ``carried_out`` every order that it has obeyed. In its loader, for the
    reason ``in_loader`` if that is not None, it obeys nothing.
    """

    def __init__(
        self,
        serial: int = 7,
        boot: int = 1,
        born_s: float = 0.0,
        drift: float = 0.0,
        sweep_s: float = 0.3,
        protocol: int = frames.PROTOCOL,
        life: int = 0xB0A7,
        knows_turns: bool = False,
    ) -> None:
        self.serial, self.protocol, self.life = serial, protocol, life
        self.knows_turns = knows_turns
        self.boot, self.drift, self.sweep_s = boot, drift, sweep_s
        self.made: list[AnySweep] = []
        self.carried_out: list[frames.Order] = []
        self.heard: list[frames.Frame] = []
        self.ring: deque[AnySweep] = deque()
        self.waypoint = frames.NO_WAYPOINT
        self.plan, self.calibration, self.trim, self.stored = OWN_PLAN, OWN_CALIBRATION, frames.NO_TEMPERATURE, 1
        self.reset_cause, self.reset_note = 0x02, 0  # the supply has come up
        self.in_loader: frames.Stay | None = None
        self._power_up(born_s)

    def reset(self, now_s: float, cause: int = 0x10, note: int = 0) -> None:
        """Restart under the next boot number; the ring outlives it."""
        self.boot += 1
        self.reset_cause, self.reset_note = cause, note
        self._power_up(now_s)

    def tick(self, now_s: float) -> int:
        """The unit's time."""
        return int((now_s - self._born_s) * (1 + self.drift) * TICKS_PER_S)

    def make_sweep(self, now_s: float) -> AnySweep:
        """Put a sweep that begins now into the ring."""
        self._sequence += 1
        readings = (Reading(-24576, 0, 34000 + self._sequence), Reading(-20480, 15000, NoEcho.NO_ECHO))
        content = (self.tick(now_s), self.waypoint, frames.NO_TEMPERATURE, 0, readings)
        if self.protocol == 2:
            sweep: AnySweep = Sweep2(self.boot, self._sequence, *content)
        else:
            sweep = Sweep(self.boot, self._sequence, self.serial, self.life, *content)
        self.made.append(sweep)
        self.ring.append(sweep)
        return sweep

    def receive(self, data: bytes, now_s: float) -> None:
        """Take in what came over the line."""
        for frame in self._reader.feed(data):
            self._take(frame, now_s)

    def output(self, now_s: float) -> bytes:
        """Make the sweeps that are due, and give what is to be sent."""
        if self.in_loader is not None:
            written = bytes(self._out)
            self._out.clear()
            return written
        while self._started and now_s >= self._next_sweep_s and len(self.ring) < RING_SWEEPS:
            self.make_sweep(max(self._next_sweep_s, self._born_s))
            self._next_sweep_s = max(self._next_sweep_s, now_s - self.sweep_s) + self.sweep_s
        if self.ring and (self.ring[0] is not self._sent or now_s >= self._resend_s):
            self._send_oldest(now_s)
        written = bytes(self._out)
        self._out.clear()
        return written

    def _power_up(self, now_s: float) -> None:
        self._born_s = now_s
        self._sequence = 0
        self._started = self._in_turn = False
        self._next_sweep_s = now_s
        self._sent: AnySweep | None = None
        self._resends = 0
        self._resend_s = 0.0
        self._out = bytearray()
        self._reader = FrameReader()
        self._last: tuple[frames.Frame, bytes] | None = None

    def _send_oldest(self, now_s: float) -> None:
        self._resends = self._resends + 1 if self.ring[0] is self._sent else 0
        self._sent = self.ring[0]
        self._resend_s = now_s + RESEND_AFTER_S[min(self._resends, len(RESEND_AFTER_S) - 1)]
        self._out += encode(self._sent)

    def say_hello(self) -> None:
        """Send HELLO, as an application does when it has booted."""
        self._out += encode(self._hello(0))

    def say_loader(self, request: int = 0) -> None:
        """Send LOADER, as a loader does each second."""
        assert self.in_loader is not None
        self._out += encode(frames.Loader(request, self.protocol, self.serial, 1, 1, self.in_loader, 0, 1, 0))

    def _take(self, frame: frames.Frame, now_s: float) -> None:
        self.heard.append(frame)
        if self.in_loader is not None:
            if isinstance(frame, frames.AskHello):
                self.say_loader(frame.request)
            return
        if isinstance(frame, frames.For) and self.protocol == 2:
            self._out += encode(frames.Rejected(2, frame.TYPE))
            return
        self._resends = 0  # the waits begin again with every frame of the host
        self._resend_s = min(self._resend_s, now_s + RESEND_AFTER_S[0])
        if isinstance(frame, frames.AskHello):
            self._resend_s = now_s
        if isinstance(frame, frames.Ack | frames.Ack2):
            self._take_acknowledgement(frame)
            return
        if self._last is None or self._last[0] != frame:
            self._last = (frame, encode(self._answer(frame, now_s)))
        self._out += self._last[1]

    def _take_acknowledgement(self, ack: frames.Ack | frames.Ack2) -> None:
        """A unit of protocol 2 knows Ack2 only, and takes it for any sweep; later ones for a sweep of protocol 2."""
        if not self.ring:
            return
        oldest = self.ring[0]
        if isinstance(ack, frames.Ack) and self.protocol == 2:
            self._out += encode(frames.Rejected(2, ack.TYPE))
        elif isinstance(ack, frames.Ack):
            named = isinstance(oldest, Sweep) and (oldest.boot, oldest.sequence, oldest.serial, oldest.life)
            if named == (ack.boot, ack.sequence, ack.serial, ack.life):
                self.ring.popleft()
        elif (oldest.boot, oldest.sequence) == (ack.boot, ack.sequence) and (
            self.protocol == 2 or isinstance(oldest, Sweep2)
        ):
            self.ring.popleft()

    def _answer(self, frame: frames.Frame, now_s: float) -> frames.Frame:
        match frame:
            case frames.AskHello():
                return self._hello(frame.request)
            case frames.AskClock():
                return frames.Clock(frame.request, self.tick(now_s), self.tick(now_s))
            case frames.AskStatus():
                return self._status(frame.request, now_s)
            case frames.AskSettings():
                return self._settings(frame.request)
            case frames.AskMechanics():
                return frames.Mechanics(frame.request, frames.NO_SLIP, *14 * (0,))
        if isinstance(frame, frames.For):
            if (frame.serial, frame.life) != (self.serial, self.life):
                return frames.Result(frame.order.request, frame.order.TYPE, Outcome.NOT_FOR_THIS_UNIT)
            frame = frame.order
        assert isinstance(frame, frames.Order)
        return self._obey(frame, now_s)

    def _obey(self, order: frames.Order, now_s: float) -> frames.Frame:
        outcome = Outcome.DONE
        match order:
            case frames.Configure() if self._started:
                outcome = Outcome.BUSY
            case frames.Configure() if not 1 <= order.count <= frames.MAX_READINGS:
                outcome = Outcome.OUT_OF_RANGE
            case frames.Configure():
                self.plan, self.stored = order, 0
            case frames.Calibrate():
                self.calibration, self.stored = order, 0
            case frames.TrimTemperature():
                self.trim, self.stored = order.temperature - CHIP_TEMPERATURE, 0
            case frames.Store():
                self.stored = 1
            case frames.Start():
                self._started, self._next_sweep_s = True, now_s
                self._in_turn = order.period != 0
            case frames.Stop():
                self._started = self._in_turn = False
            case frames.Single():
                self.make_sweep(now_s)
            case frames.SetWaypoint():
                self.waypoint = order.waypoint
        if outcome == Outcome.DONE:
            self.carried_out.append(replace(order, request=0))
        return frames.Result(order.request, order.TYPE, outcome)

    def _hello(self, request: int) -> frames.Hello:
        return frames.Hello(
            request=request,
            protocol=self.protocol,
            serial=self.serial,
            version_major=0,
            version_minor=5 if self.knows_turns else 1,
            version_patch=0,
            boot=self.boot,
            reset_cause=self.reset_cause,
            reset_note=self.reset_note,
            ring_capacity=3000,
            life=self.life if self.protocol >= 3 else frames.NO_LIFE,
        )

    def _settings(self, request: int) -> frames.Settings:
        plan, calibration = (vars(each) for each in (self.plan, self.calibration))
        return frames.Settings(
            **{**plan, **calibration, "request": request}, stored=self.stored, temperature_trim=self.trim
        )

    def _status(self, request: int, now_s: float) -> frames.Status:
        state = State.SWEEPING if self._started else State.IDLE
        return frames.Status(
            request=request,
            state=State.WAITING if len(self.ring) >= RING_SWEEPS else state,
            flags=STARTED * self._started | IN_TURN * self._in_turn,
            fault=0,
            waypoint=self.waypoint,
            bearing=0,
            ring_used=120 * len(self.ring),
            sweeps_waiting=len(self.ring),
            sweeps_made=self._sequence,
            sweeps_resent=0,
            frames_bad=self._reader.frames_bad,
            frames_unknown=0,
            bytes_lost=0,
            echo_faults=0,
            temperature=CHIP_TEMPERATURE,
            stack_free=40,
            tick=self.tick(now_s),
        )
