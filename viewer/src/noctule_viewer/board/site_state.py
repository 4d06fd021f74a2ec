"""What the viewer has last heard from a site, and when: the callbacks of a client fill it, the board reads it."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import monotonic, time

from noctule import poses
from noctule.messages_pb2 import Contour, ServiceStatus, Sweep, UnitStatus
from noctule_viewer.board.heard_sweeps import AHEAD_S, HeardSweep, HeardSweeps

_MOST_UNITS = 1_000  # as strangers could name them


@dataclass(frozen=True)
class Heard:
    """What a site has said, and for how many seconds each has been silent by a clock that nobody sets."""

    now_s: float  # UTC
    alive: frozenset[str] = frozenset()
    units: dict[tuple[str, str], UnitStatus] = field(default_factory=dict)  # by unit and gateway
    unit_silent_s: dict[tuple[str, str], float] = field(default_factory=dict)  # in the same way
    sweepless_s: dict[tuple[str, str], float] = field(default_factory=dict)  # so long sweeping, and none was logged
    services: dict[str, ServiceStatus] = field(default_factory=dict)
    service_silent_s: dict[str, float] = field(default_factory=dict)
    swept_s: dict[str, float] = field(default_factory=dict)  # UTC: when the last sweep was made
    stands_m: dict[str, tuple[float, float]] = field(default_factory=dict)  # where: as the contour has it, or the sweep
    sweeps: dict[str, Sequence[HeardSweep]] = field(default_factory=dict)  # by unit: its last sweeps
    contour: Contour | None = None
    own_trouble: str = ""  # of the viewer's own way over the bus


class SiteState:
    """For several threads. ``now`` counts seconds evenly, ``utc`` is the time of day in seconds."""

    def __init__(self, now: Callable[[], float] = monotonic, utc: Callable[[], float] = time) -> None:
        self._now, self._utc = now, utc
        self._lock = threading.Lock()
        self._alive: set[str] = set()
        self._units: dict[tuple[str, str], UnitStatus] = {}
        self._unit_heard_s: dict[tuple[str, str], float] = {}
        self._sweepless_since_s: dict[tuple[str, str], float] = {}
        self._services: dict[str, ServiceStatus] = {}
        self._service_heard_s: dict[str, float] = {}
        self._swept_s: dict[str, float] = {}
        self._stated_m: dict[str, tuple[float, float]] = {}
        self._sweeps = HeardSweeps()
        self._contour: Contour | None = None
        self._own_trouble = "the viewer waits for a router"

    def note_alive(self, unit: str, alive: bool) -> None:
        """A gateway serves ``unit``, or none does."""
        with self._lock:
            if not alive:
                self._alive.discard(unit)
            elif len(self._alive) < _MOST_UNITS:
                self._alive.add(unit)

    def note_unit(self, status: UnitStatus) -> None:
        """A status of a unit."""
        key = (status.unit, status.gateway)
        with self._lock:
            if key in self._units or len(self._units) < _MOST_UNITS:
                if status.state != UnitStatus.STATE_SWEEPING or _done(status) != _done(self._units.get(key)):
                    self._sweepless_since_s[key] = self._now()
                self._units[key] = status
                self._unit_heard_s[key] = self._now()

    def note_service(self, status: ServiceStatus) -> None:
        """A status of a service."""
        with self._lock:
            if status.name in self._services or len(self._services) < _MOST_UNITS:
                self._services[status.name] = status
                self._service_heard_s[status.name] = self._now()
            for cursor in status.cursors:
                if cursor.HasField("time"):
                    self._note_swept(cursor.unit, cursor.time.ToNanoseconds() / 1e9)

    def note_sweep(self, sweep: Sweep) -> None:
        """A sweep as it was made."""
        with self._lock:
            self._note_swept(sweep.unit, sweep.start.ToNanoseconds() / 1e9)
            self._sweeps.note(sweep, self._utc())
            if sweep.HasField("pose") and not poses.is_unknown(sweep.pose) and sweep.unit in self._swept_s:
                self._stated_m[sweep.unit] = sweep.pose.x_m, sweep.pose.y_m

    def note_contour(self, contour: Contour) -> None:
        """The site's newest contour."""
        with self._lock:
            self._contour = contour

    def note_own_trouble(self, trouble: str) -> None:
        """What is wrong with the viewer's own way over the bus; empty where nothing is."""
        with self._lock:
            self._own_trouble = trouble

    def heard(self) -> Heard:
        """All of it, as it is now."""
        now_s = self._now()
        with self._lock:
            return Heard(
                now_s=self._utc(),
                alive=frozenset(self._alive),
                units=dict(self._units),
                unit_silent_s={key: now_s - heard_s for key, heard_s in self._unit_heard_s.items()},
                sweepless_s={key: now_s - since_s for key, since_s in self._sweepless_since_s.items()},
                services=dict(self._services),
                service_silent_s={name: now_s - heard_s for name, heard_s in self._service_heard_s.items()},
                swept_s=dict(self._swept_s),
                stands_m=self._stated_m | _placed_m(self._contour),
                sweeps=self._sweeps.all(),
                contour=self._contour,
                own_trouble=self._own_trouble,
            )

    def _note_swept(self, unit: str, swept_s: float) -> None:
        if unit in self._swept_s or len(self._swept_s) < _MOST_UNITS:
            before_s = self._swept_s.get(unit, 0.0)
            ahead = before_s > self._utc() + AHEAD_S  # a clock was wrong, or still is
            self._swept_s[unit] = swept_s if ahead else max(swept_s, before_s)


def _done(status: UnitStatus | None) -> tuple[int, str, int] | None:
    """What the unit does, and where its log has got to."""
    return (status.state, status.log_id, status.log_head) if status is not None else None


def _placed_m(contour: Contour | None) -> dict[str, tuple[float, float]]:
    placed = [pose for pose in contour.poses if poses.is_placed(pose)] if contour is not None else []
    return {pose.unit: (pose.x_m, pose.y_m) for pose in placed}
