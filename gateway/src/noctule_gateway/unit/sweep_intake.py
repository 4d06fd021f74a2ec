"""A unit's sweeps from its link to the log and the bus: given time, place and drift, committed, then acknowledged."""

import hashlib
import time
from collections.abc import Callable

from noctule.messages_pb2 import UnitFault
from noctule_gateway.clock.boot_clocks import Anchor, BootClocks, TickLine
from noctule_gateway.clock.regression import Exchange, HostTime
from noctule_gateway.errors import CommandError, LogError
from noctule_gateway.link.link import Link
from noctule_gateway.log.log_file import Arrival, Committed
from noctule_gateway.pose import pose_of_sweep
from noctule_gateway.served_unit import ServedUnit
from noctule_gateway.status.service_quality import Lateness
from noctule_gateway.unit.step_check import StepCheck
from noctule_gateway.unit.sweep_health import SweepHealth
from noctule_gateway.wire.codec import encode
from noctule_gateway.wire.frames import AnySweep, Mechanics, Status
from noctule_gateway.wire.sweep_message import ticks_of, to_message, waypoint_of

Call = Callable[[Callable[[], None]], None]

_NOT_KEPT = (
    "the room is accepted, but the disk does not take that, so a restart of the gateway may forget it: "
    "look at the data folder's disk, then accept the room again"
)


class SweepIntake:
    """``publish`` gets each sweep's record after its commit; ``call`` has a function called on the line's thread."""

    def __init__(
        self,
        served: ServedUnit,
        link: Link,
        publish: Callable[[bytes], None],
        call: Call,
    ) -> None:
        self.committed = self.without_pose = self.clocks_refused = 0
        self.lost_pose = False  # of the latest sweep
        self._logged_s: float | None = None  # monotonic: when the newest sweep was committed
        self._served = served
        self._link, self._publish, self._call = link, publish, call
        self._clocks = BootClocks(served.site.clock == "unit", self._anchor)
        self._lateness = Lateness()
        self._health = SweepHealth(served.unit, served.site.name, served.log.path)
        self._check = StepCheck(served.site.name, served.unit.name)
        self._flagged_by_check = 0
        self._boot = 0

    def begin_boot(self, boot: int) -> None:
        """The unit has said that it runs under ``boot``, a boot_of_life."""
        self._boot = boot
        self._clocks.begin(boot, time.monotonic(), self._served.clock.look().utc_offset_s)

    def clock_read(self, exchange: Exchange) -> None:
        """A CLOCK exchange with the unit; one that does not fit those before is counted in ``clocks_refused``."""
        self.clocks_refused += not self._clocks.add(exchange)

    @property
    def clock_error_s(self) -> float:
        """One standard deviation of the UTC that a sweep made now would get."""
        return self._clocks.error_s

    @property
    def clock_line(self) -> TickLine | None:
        """The unit's ticks as UTC, from its last exchange on."""
        return self._clocks.line(self._served.clock.look().utc_offset_s)

    @property
    def clock_drift(self) -> float:
        """By how much the unit's oscillator is fast, seconds per second."""
        return self._clocks.drift

    @property
    def worst_lateness_s(self) -> float:
        """The longest that a sweep had to wait for its commit lately."""
        return self._lateness.worst_s(time.monotonic())

    @property
    def late(self) -> bool:
        """Sweeps are acknowledged later than they should be: the machine can't keep up."""
        return self._lateness.too_late(time.monotonic())

    @property
    def faults(self) -> list[UnitFault]:
        """What its sweeps and its own checks show to be wrong with the unit."""
        epoch = self._served.clock.look().epoch
        return self._check.added_to(self._health.faults(epoch), epoch)

    @property
    def flagged(self) -> int:
        """Sweeps that carried a fault."""
        return self._health.flagged + self._flagged_by_check

    def last_sweep_utc_s(self) -> float | None:
        """When the newest sweep was logged, by the clock as it is now; None before the first."""
        return None if self._logged_s is None else time.time() - (time.monotonic() - self._logged_s)

    def checked(self, mechanics: Mechanics) -> None:
        """The unit has told what its latest check found."""
        self._check.checked(mechanics)

    def status_read(self, status: Status) -> None:
        """The unit has told whether that check found its bearings off."""
        self._check.said(self._boot, status)

    def accept_room(self, done: Callable[[CommandError | None], None]) -> None:
        """Forget what the unit used to hear; ``done`` is called on the line's thread once that is on the disk.

        It gets an error where the disk does not take it. Raises CommandError for a unit that is carried.
        """
        self._health.accept_room()
        memory = self._health.memory()

        def keep() -> None:
            kept = memory is None or self._health.save(memory)
            self._call(lambda: done(None if kept else CommandError(_NOT_KEPT)))

        self._served.log.run(keep)

    def take(self, sweep: AnySweep) -> None:
        """A sweep has come from the unit."""
        wall = self._served.clock.look()
        when = self._clocks.sweep_time(sweep.boot_of_life, ticks_of(sweep), wall.utc_offset_s)
        began_s = when.start.time_s - wall.utc_offset_s
        pose = pose_of_sweep(self._served.unit.pose, waypoint_of(sweep), began_s, self._served.track)
        self.lost_pose = pose is None
        message = to_message(sweep, self._served.site, self._served.unit, when, pose)
        message.clock_epoch = wall.epoch
        digest = hashlib.blake2b(encode(sweep), digest_size=16).digest()
        self._health.judge(message, digest)
        flagged = self._check.mark(message, sweep)
        memory = self._health.memory()
        arrived_s = time.monotonic()

        def done(result: Committed | LogError) -> None:
            if isinstance(result, Committed) and result.fresh:
                self._publish(result.record)
            self._call(lambda: self._done(sweep, result, arrived_s, placed=pose is not None, flagged=flagged))
            if memory is not None:
                self._health.save(memory)

        self._served.log.append(Arrival(digest, sweep.start, message), done)

    def _done(
        self, sweep: AnySweep, result: Committed | LogError, arrived_s: float, placed: bool, flagged: bool
    ) -> None:
        now_s = time.monotonic()
        self._lateness.note(now_s - arrived_s, now_s)
        if isinstance(result, LogError):
            self._link.failed(sweep)
            return
        self._link.committed(sweep, now_s)
        self.committed += result.fresh
        self._logged_s = now_s if result.fresh else self._logged_s
        self.without_pose += result.fresh and not placed
        self._flagged_by_check += result.fresh and flagged

    def _anchor(self, boot: int) -> Anchor | None:
        """The newest sweep of ``boot`` in the log, if the host's clock has not been set since."""
        try:
            found = self._served.log.last_of_boot(boot)
        except LogError:
            return None  # its trouble is shown in the status; the exchanges tell the time without it
        if found is None or found[1].clock_epoch != self._served.clock.look().epoch:
            return None
        start_tick, sweep = found
        return start_tick, HostTime(sweep.start.ToNanoseconds() / 1e9, sweep.clock_error_s)
