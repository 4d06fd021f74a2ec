"""One unit of the site file, with what the gateway keeps of it."""

from dataclasses import dataclass

from noctule.site import Site, Unit
from noctule_gateway.clock.clock_watch import ClockWatch
from noctule_gateway.log.sweep_log import SweepLog
from noctule_gateway.pose import PoseTrack
from noctule_gateway.turns.timetable import Crowd, Turn


@dataclass(frozen=True)
class ServedUnit:
    """A unit of ``site``: its ``log``, the poses that others have published for it, the host's ``clock``, its turn."""

    site: Site
    unit: Unit
    log: SweepLog
    track: PoseTrack
    clock: ClockWatch
    turn: Turn | Crowd | None = None
