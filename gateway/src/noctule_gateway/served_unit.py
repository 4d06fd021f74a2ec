"""One unit of the site file, with what the gateway keeps of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from noctule.site import Site, Unit
from noctule_gateway.clock.clock_watch import ClockWatch
from noctule_gateway.log.sweep_log import SweepLog
from noctule_gateway.pose import PoseTrack
from noctule_gateway.turns.timetable import Crowd, Turn
from noctule_gateway.wire.frames import Configure


@dataclass(frozen=True)
class ServedUnit:
    """A unit of ``site``: its ``log``, the poses that others have published for it, the host's ``clock``, its turn.

    ``not_reckoned_with`` names the units that could hear it out of turn if it goes by another plan than expected.
    """

    site: Site
    unit: Unit
    log: SweepLog
    track: PoseTrack
    clock: ClockWatch
    turn: Turn | Crowd | None = None
    not_reckoned_with: Callable[[Configure], Sequence[str]] = lambda _: ()
