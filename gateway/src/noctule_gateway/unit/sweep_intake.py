"""A unit's sweeps from its link to the log and the bus: given time, place and drift, committed, then acknowledged."""

import hashlib
import time
from collections.abc import Callable

from noctule.site import Site, Unit
from noctule_gateway.clock.boot_clocks import Anchor, BootClocks
from noctule_gateway.errors import LogError
from noctule_gateway.link.link import Link
from noctule_gateway.log.log_file import Arrival, Committed
from noctule_gateway.log.sweep_log import SweepLog
from noctule_gateway.pose import PoseTrack, pose_of_sweep
from noctule_gateway.status.health import Lateness
from noctule_gateway.wire.codec import encode
from noctule_gateway.wire.frames import Sweep
from noctule_gateway.wire.sweep_message import to_message, waypoint_of

Call = Callable[[Callable[[], None]], None]


class SweepIntake:
    """``publish`` gets each sweep's record after its commit; ``call`` has a function called on the line's thread."""

    def __init__(
        self,
        site: Site,
        unit: Unit,
        log: SweepLog,
        track: PoseTrack,
        link: Link,
        publish: Callable[[bytes], None],
        call: Call,
    ) -> None:
        self.clocks = BootClocks(site.clock == "unit", self._anchor)
        self.lateness = Lateness()
        self.committed = self.without_pose = 0
        self.lost_pose = False  # of the latest sweep
        self._site, self._unit, self._log, self._track = site, unit, log, track
        self._link, self._publish, self._call = link, publish, call

    def take(self, sweep: Sweep) -> None:
        """A sweep has come from the unit."""
        start = self.clocks.at(sweep.boot, sweep.start, utc_offset_s())
        pose = pose_of_sweep(self._unit.pose, waypoint_of(sweep), start.time_s, self._track)
        self.lost_pose = pose is None
        drift = self.clocks.good_drift(sweep.boot)
        message = to_message(sweep, self._site, self._unit, start, pose, drift)
        arrived_s = time.monotonic()
        digest = hashlib.blake2b(encode(sweep), digest_size=16).digest()

        def done(result: Committed | LogError) -> None:
            if isinstance(result, Committed) and result.fresh:
                self._publish(result.record)
            self._call(lambda: self._done(sweep, result, arrived_s, placed=pose is not None))

        self._log.append(Arrival(digest, sweep.start, message), done)

    def _done(self, sweep: Sweep, result: Committed | LogError, arrived_s: float, placed: bool) -> None:
        now_s = time.monotonic()
        self.lateness.note(now_s - arrived_s, now_s)
        if isinstance(result, LogError):
            self._link.failed(sweep)
            return
        self._link.committed(sweep)
        self.committed += result.fresh
        self.without_pose += result.fresh and not placed

    def _anchor(self, boot: int) -> Anchor | None:
        try:
            return self._log.last_of_boot(boot)
        except LogError:
            return None  # its trouble is shown in the status; the exchanges tell the time without it


def utc_offset_s() -> float:
    """UTC less the monotonic clock, now."""
    return time.time() - time.monotonic()
