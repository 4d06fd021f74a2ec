"""A survey put on the bus again, so that readers take it for units that are sweeping now."""

import threading
import uuid
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from time import monotonic

import zenoh
from google.protobuf.timestamp_pb2 import Timestamp

from noctule import awake, bounds, bus, keys
from noctule.client import Client
from noctule.errors import BoundsError, KeyFormatError, SurveyError
from noctule.messages_pb2 import (
    CommandReply,
    CommandRequest,
    Cursor,
    LogRecords,
    ServiceStatus,
    Sweep,
    UnitStatus,
)

STATUS_INTERVAL_S = 1.0
FIRMWARE = "replay"

_MAX_RECORDS = 500


class ReplayedUnit:
    """A unit of a survey as a gateway would show it: alive, with a status, a log (in memory, new), and answers."""

    def __init__(self, session: zenoh.Session, site: str, unit: str) -> None:
        self._site = site
        self._unit = unit
        self._log_id = uuid.uuid4().hex
        self._log: list[Sweep] = []
        self._state, self._since = UnitStatus.STATE_IDLE, Timestamp()
        self._since.GetCurrentTime()
        self._logged = Timestamp()  # when the newest sweep was
        self._log_key = keys.log(site, unit)
        self._publisher = bus.declare_publisher(session, keys.sweep(site, unit), Sweep)
        self._status = bus.StatePublisher(session, keys.unit_status(site, unit), UnitStatus)
        self._queryables = [
            session.declare_queryable(self._log_key, self._answer_log, complete=True),
            session.declare_queryable(keys.rpc(site, unit, keys.ANY), self._answer_command, complete=True),
        ]
        self.publish_status()
        # Last, so that a client that sees the unit finds its log.
        self._token = session.liveliness().declare_token(keys.alive(site, unit))

    def publish(self, sweep: Sweep) -> None:
        """Log a sweep under this site and log, its start as it was, then publish it."""
        logged = Sweep()
        logged.CopyFrom(sweep)
        logged.site = self._site
        logged.log_id = self._log_id
        logged.log_sequence = len(self._log) + 1
        self._log.append(logged)
        self._logged.GetCurrentTime()
        self._enter(UnitStatus.STATE_SWEEPING)
        self._publisher.put(logged.SerializeToString())

    def rest(self) -> None:
        """Publish that no sweep comes for now."""
        self._enter(UnitStatus.STATE_IDLE)
        self.publish_status()

    def publish_status(self) -> None:
        """Publish where the log has got to."""
        self._status.put(self._present())

    def head(self) -> Cursor:
        """The cursor of a reader that has read all."""
        return Cursor(unit=self._unit, log_id=self._log_id, log_sequence=len(self._log))

    def close(self) -> None:
        """Leave the bus."""
        self._token.undeclare()
        for queryable in self._queryables:
            queryable.undeclare()
        self._status.close()
        self._publisher.undeclare()

    def _enter(self, state: UnitStatus.State) -> None:
        if state != self._state:
            self._state = state
            self._since.GetCurrentTime()

    def _present(self) -> UnitStatus:
        status = UnitStatus(
            site=self._site,
            unit=self._unit,
            state=self._state,
            firmware=FIRMWARE,
            homed=True,
            log_id=self._log_id,
            log_head=len(self._log),
            log_tail=1,
            gateway=FIRMWARE,
            gateway_version=version("noctule"),
        )
        status.time.GetCurrentTime()
        status.since.CopyFrom(self._since)
        if self._log:
            status.last_sweep.CopyFrom(self._logged)
            status.boot = self._log[-1].boot
        return status

    def _answer_log(self, query: zenoh.Query) -> None:
        try:
            first = int(query.parameters.get("from") or 1)
            most = int(query.parameters.get("max") or _MAX_RECORDS)
        except ValueError:
            query.reply_err(f"{query.parameters} is not from=N;max=M with whole numbers".encode())
            return
        head = len(self._log)
        begin = max(first, 1) - 1
        sweeps = self._log[begin : begin + min(most, _MAX_RECORDS)]
        records = LogRecords(log_id=self._log_id, head=head, tail=1, sweeps=sweeps)
        query.reply(self._log_key, records.SerializeToString(), encoding=bus.encoding(LogRecords))

    def _answer_command(self, query: zenoh.Query) -> None:
        try:
            command = keys.parse_rpc(str(query.key_expr))
            request = bounds.decode(CommandRequest, query.payload.to_bytes() if query.payload else b"")
        except (BoundsError, KeyFormatError) as error:
            query.reply_err(str(error))
            return
        reply = CommandReply(request_id=request.request_id)
        if command in ("hello", "status"):
            reply.done = True
            reply.status.CopyFrom(self._present())
        else:
            reply.error = f"unit {self._unit!r} is a replayed survey: it can't be commanded"
        query.reply(query.key_expr, reply.SerializeToString(), encoding=bus.encoding(CommandReply))


class Replay:
    """The units of a survey; each appears with its first sweep."""

    def __init__(self, session: zenoh.Session, site: str) -> None:
        self._session = session
        self._site = site
        self._units: dict[str, ReplayedUnit] = {}
        self._status_at_s = monotonic()

    def run(self, sweeps: Iterable[Sweep], speed: float | None, over: threading.Event | None = None) -> None:
        """Publish ``sweeps`` until ``over``, ``speed`` times as fast as they were made; with None as fast as they go.

        Raises SurveyError where a sweep has no start to keep time by, and KeyFormatError where its unit can't be a key.
        """
        over = over or threading.Event()
        first: dict[str, tuple[float, int]] = {}  # of each clock epoch, since one's times don't go on from another's
        for number, sweep in enumerate(sweeps, start=1):
            if speed is not None:
                if not sweep.HasField("start"):
                    raise SurveyError(f"sweep {number} of the survey has no start: replay it at speed max")
                start_ns = sweep.start.ToNanoseconds()
                began_s, first_ns = first.setdefault(sweep.clock_epoch, (monotonic(), start_ns))
                self.wait(began_s + (start_ns - first_ns) * 1e-9 / speed, over)
            if over.is_set():
                return
            self._unit(sweep.unit).publish(sweep)
            self._publish_statuses()
        for unit in self._units.values():
            unit.rest()

    def wait(self, until_s: float, over: threading.Event) -> None:
        """Wait until that time of the monotonic clock, or until ``over``, publishing statuses meanwhile."""
        while (left_s := until_s - monotonic()) > 0.0 and not over.wait(min(left_s, awake.EVERY_S)):
            self._publish_statuses()

    def heads(self) -> dict[str, Cursor]:
        """By unit, the cursor of a reader that has read all."""
        return {name: unit.head() for name, unit in self._units.items()}

    def close(self) -> None:
        """Take all units off the bus."""
        for unit in self._units.values():
            unit.close()

    def _unit(self, name: str) -> ReplayedUnit:
        if name not in self._units:
            self._units[name] = ReplayedUnit(self._session, self._site, name)
        return self._units[name]

    def _publish_statuses(self) -> None:
        if monotonic() >= self._status_at_s + STATUS_INTERVAL_S:
            self._status_at_s = monotonic()
            for unit in self._units.values():
                unit.publish_status()


class Readers:
    """How far the services of a site have read, by the cursors that they show in their statuses."""

    def __init__(self, client: Client) -> None:
        self._cursors: dict[str, list[Cursor]] = {}
        self._lock = threading.Lock()
        client.on_service_status(self._note)

    def have_passed(self, heads: Mapping[str, Cursor]) -> bool:
        """Whether each unit was read to its head by somebody, and by all who read it."""
        with self._lock:
            return all(map(self._is_read, heads.values()))

    def _note(self, status: ServiceStatus) -> None:
        with self._lock:
            self._cursors[status.name] = list(status.cursors)

    def _is_read(self, head: Cursor) -> bool:
        shown = [cursor for cursors in self._cursors.values() for cursor in cursors]
        here = [cursor for cursor in shown if (cursor.unit, cursor.log_id) == (head.unit, head.log_id)]
        return bool(here) and all(cursor.log_sequence >= head.log_sequence for cursor in here)
