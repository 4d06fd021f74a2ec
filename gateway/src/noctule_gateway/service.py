"""The gateway of a site: a server for each unit, a log for each, and what each has on the bus.

Units are served with or without a bus: what is committed while no router answers is read from the logs later.
"""

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path

import zenoh

from noctule import bus, elapsed, keys
from noctule.bus_watch import BusWatch
from noctule.caller import Callers
from noctule.elapsed import Instant
from noctule.folder_lock import FolderLock, Owner
from noctule.kernel_clock import KernelClock, kernel_clock
from noctule.messages_pb2 import ServiceStatus, UnitStatus
from noctule.newer_fields import NewerFields
from noctule.site import Site, Unit
from noctule_gateway.audit.allowance import REFUSALS
from noctule_gateway.audit.audit_log import AuditLog
from noctule_gateway.bus.held_bytes import HeldBytes
from noctule_gateway.bus.log_readers import LogReaders
from noctule_gateway.bus.outbox import Outbox
from noctule_gateway.bus.recorded_commands import RecordedCommands
from noctule_gateway.bus.refused_commands import RefusedCommands
from noctule_gateway.bus.unit_on_bus import UnitOnBus
from noctule_gateway.clock.clock_watch import ClockWatch
from noctule_gateway.clock.synchronisation import Synchronisation
from noctule_gateway.log.log_file import Retention
from noctule_gateway.log.sweep_log import SweepLog
from noctule_gateway.pose import PoseTrack
from noctule_gateway.served_unit import ServedUnit
from noctule_gateway.turns.site_turns import not_reckoned_with, site_turns
from noctule_gateway.turns.timetable import Crowd, Turn
from noctule_gateway.unit.plans import expected_plan
from noctule_gateway.unit.unit_server import UnitServer
from noctule_gateway.update.admission import Admission
from noctule_gateway.wire.frames import Configure

_HANGS_AFTER_S = 30.0  # without a status of a unit; opening a line takes 5 s at the most
_LINES_WITHIN_S = 2.0  # for all lines to close
_CLOSED_WITHIN_S = 3.5  # lines and logs; with Zenoh's session the gateway ends within 5 s
_EPOCH_FILE = "clock-epoch.json"
_LISTED = 10  # units that a status names; a site may have hundreds

Clock = Callable[[], Instant]

_log = logging.getLogger(__name__)

VERSION = version("noctule-gateway")


class _Served:
    """One unit: its log, its server, and what it has on the bus, once there is one."""

    def __init__(
        self,
        site: Site,
        unit: Unit,
        data: Path,
        retention: Retention,
        gateway: str,
        now: Clock,
        clock: ClockWatch,
        admission: Admission,
        plans: Mapping[str, Configure],
        turns: Mapping[str, Turn | Crowd],
    ) -> None:
        self.unit = unit
        self.on_bus: UnitOnBus | None = None
        self.latest: UnitStatus | None = None
        self.reported_s = time.monotonic()  # its line's thread makes a status each second
        self._gateway = gateway
        self.log = SweepLog(data / f"{unit.name}.sqlite", retention, now)
        unknown_to_turns = partial(not_reckoned_with, site, plans, turns, unit.name)
        self.kept = ServedUnit(site, unit, self.log, PoseTrack(), clock, turns.get(unit.name), unknown_to_turns)
        self.server = UnitServer(self.kept, self._publish, self._report, admission)

    def _publish(self, record: bytes) -> None:
        if self.on_bus is not None:
            self.on_bus.publish(record)

    def _report(self, status: UnitStatus) -> None:
        status.gateway, status.gateway_version = self._gateway, VERSION
        self.latest, self.reported_s = status, time.monotonic()
        if self.on_bus is not None:
            self.on_bus.report(status)


class Gateway:
    """Serves the units of ``site`` from start() to close(), with their logs in the folder ``data``.

    ``admission`` says which firmware images the units get; left out, none.
    Raises FolderError if the folder can't be used or another process holds it, CommandError if a plan of the site file
    does not fit a unit.
    """

    def __init__(
        self,
        site: Site,
        data: Path,
        name: str = "gateway",
        retention: Retention | None = None,
        now: Clock = elapsed.now,
        kernel_clock: Callable[[], KernelClock] = kernel_clock,
        admission: Admission | None = None,
    ) -> None:
        self._site, self._name = site, keys.name(name, "gateway name")
        self._folder = FolderLock(data, Owner("gateway", site.name, self._name))
        self._clock_watch, self._synchronisation = ClockWatch(data / _EPOCH_FILE, now), Synchronisation(kernel_clock)
        retention, admission = retention or Retention(), admission or Admission()
        plans = {unit.name: expected_plan(unit) for unit in site.units}
        turns = site_turns(site, plans)
        self._served = [
            _Served(site, unit, data, retention, self._name, now, self._clock_watch, admission, plans, turns)
            for unit in site.units
        ]
        whose = {"site": site.name, "gateway": self._name, "version": VERSION}
        self._audit, self._refused = AuditLog(data, whose), AuditLog(data, whose, REFUSALS)
        self._outbox = Outbox()
        self._held = HeldBytes()
        self._readers = LogReaders()
        self._newer = NewerFields()
        self._status: bus.StatePublisher | None = None
        self._watch: BusWatch | None = None
        self._callers: Callers | None = None
        self._latest: ServiceStatus | None = None

    def start(self) -> None:
        """Begin to serve the units."""
        for served in self._served:
            served.server.start()

    def join(self, session: zenoh.Session, watch: BusWatch | None = None, tls_folder: Path | None = None) -> None:
        """Put the units on the bus, and begin to ``watch`` that others can read them.

        Commands are to be signed where there is a ``tls_folder`` (``tls.chosen``). The caller closes ``session``, after
        close(). Raises TlsError.
        """
        callers = self._callers = Callers(tls_folder)
        bus.declare_schemas(session)
        self._status = bus.StatePublisher(session, keys.service_status(self._site.name, self._name), ServiceStatus)
        for served in self._served:
            commands = RecordedCommands(served.server.command, self._audit, served.unit.name).carry_out
            refused = RefusedCommands(self._refused, served.unit.name).note
            served.on_bus = UnitOnBus(
                session, served.kept, commands, self._outbox, self._readers, self._held, self._newer, callers, refused
            )
        if watch is not None:
            self._watch = watch
            watch.begin(self._states)

    def report(self) -> None:
        """Look after the folder, the host's clock and the list of operators, and publish the gateway's own status.

        To be called each second. Raises FolderError if another process has got hold of the folder.
        """
        self._folder.keep()
        self._clock_watch.keep()
        self._synchronisation.look()
        if self._callers is not None:
            self._callers.look()
        self._latest = message = self._status_message()
        if (status := self._status) is not None:
            self._outbox.post(lambda: status.put(message))

    def statuses(self) -> Sequence[UnitStatus | ServiceStatus]:
        """The gateway's status and its units', each as it was last made. From any thread, never waiting."""
        latest = [self._latest, *(served.latest for served in self._served)]
        return [status for status in latest if status is not None]

    @property
    def makes_progress(self) -> bool:
        """At least one unit's line still makes statuses. A line that hangs is no reason to stop the others."""
        now_s = time.monotonic()
        return any(now_s - served.reported_s < _HANGS_AFTER_S for served in self._served) or not self._served

    @property
    def summary(self) -> str:
        """How the gateway fares, in a line."""
        connected = sum(served.server.connected for served in self._served)
        detail = self._latest.detail if self._latest is not None else ""
        return f"{connected} of {len(self._served)} units connected{'; ' if detail else ''}{detail}"

    def close(self) -> None:
        """Let the units go, commit what is on its way, and put on the bus what waits."""
        if self._watch is not None:
            self._watch.close()
        for served in self._served:
            served.server.stop()
        begun_s = time.monotonic()
        for served in self._served:
            served.server.join(begun_s + _LINES_WITHIN_S)
        self._readers.close()
        for log in (self._audit, self._refused):
            log.end()
        for log in (*(served.log for served in self._served), self._audit, self._refused):
            log.close(begun_s + _CLOSED_WITHIN_S)
        self._outbox.close()
        self._folder.close()

    def _states(self) -> list[bus.StatePublisher]:
        """What is published each second."""
        of_units = [served.on_bus.status for served in self._served if served.on_bus is not None]
        return of_units if self._status is None else [self._status, *of_units]

    def _status_message(self) -> ServiceStatus:
        message = ServiceStatus(
            site=self._site.name,
            name=self._name,
            role="gateway",
            version=VERSION,
            detail="; ".join(filter(None, self._details())),
            counters=self._counters(),
        )
        message.time.FromNanoseconds(time.time_ns())
        return message

    def _details(self) -> Iterator[str]:
        """What is not well, each thing in words; empty where a thing is well."""
        servers = {served.unit.name: served.server for served in self._served}
        away = [name for name, server in servers.items() if not (server.connected or server.updating)]
        yield "" if self._status else "not on the bus yet: no router has answered (see the log)"
        yield self._watch.detail() if self._watch else ""
        yield _listed("not connected", away)
        yield _listed("being updated", [name for name, server in servers.items() if server.updating])
        yield _listed("served late", [name for name, server in servers.items() if server.late])
        yield self._callers.detail if self._callers else ""
        yield self._audit.detail
        yield self._refused.detail
        yield self._clock_watch.detail
        yield self._synchronisation.detail if self._site.clock == "utc" else ""
        yield self._readers.cut_off()

    def _counters(self) -> dict[str, int]:
        return {
            "units": len(self._served),
            "units_connected": sum(served.server.connected for served in self._served),
            "units_late": sum(served.server.late for served in self._served),
            "sweeps_committed": sum(served.log.state.head for served in self._served),
            "puts_dropped": self._outbox.dropped,
            "log_queries_refused": self._readers.refused,
            "commands_refused": sum(served.on_bus.commands_refused for served in self._served if served.on_bus),
            "messages_newer": self._newer.count,
            "audit_lines": self._audit.recorded,
            "audit_lines_late_or_lost": self._audit.lost,
            "audit_lines_summed_up": self._audit.summed_up,
            "refused_lines": self._refused.recorded,
            "refused_lines_late_or_lost": self._refused.lost,
            "refused_lines_summed_up": self._refused.summed_up,
            "clock_sets": self._clock_watch.sets,
            **self._synchronisation.counters,
        }


def _listed(what: str, names: list[str]) -> str:
    if not names:
        return ""
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return f"{what}: {', '.join(names[:_LISTED])}{more}"
