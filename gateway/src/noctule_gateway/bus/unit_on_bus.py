"""A unit on the bus: its sweeps, status, log, commands and liveliness, as long as this gateway serves it."""

import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

import zenoh

from noctule import bounds, bus, caller, keys
from noctule.caller import Callers
from noctule.errors import BoundsError, CallerError, KeyFormatError
from noctule.messages_pb2 import CommandReply, CommandRequest, LogRecords, Pose, Sweep, UnitStatus
from noctule.newer_fields import NewerFields
from noctule.refusals import Refusals
from noctule.rivals import Rivals
from noctule.site import PoseKey
from noctule_gateway.bus.command_cache import STOP, CommandCache, Refused, Server
from noctule_gateway.bus.held_bytes import HeldBytes
from noctule_gateway.bus.log_readers import LONGEST_NAME, STALE_AFTER_S, LogReaders
from noctule_gateway.bus.log_reply import read_records
from noctule_gateway.bus.outbox import Outbox
from noctule_gateway.errors import LogError
from noctule_gateway.served_unit import ServedUnit

_MOST_AHEAD_S = 60.0  # of the host's clock; a pose from beyond would stand for all until then
# A unit's stops have limits of their own: only other stops to this unit can leave no room for one.
_STOPS_OF_ONE_BYTES, _STOPS_OF_ALL_BYTES = 2**16, 2**19
_REFUSED = "clients that are refused"
_TOO_LATE = f"the query waited longer than {STALE_AFTER_S:g} s in the gateway: ask again, one query at a time"


class UnitOnBus:
    """What one unit has on the bus. ``readers`` reads the log for queries: Zenoh's own threads must never wait."""

    def __init__(
        self,
        session: zenoh.Session,
        served: ServedUnit,
        server: Server,
        outbox: Outbox,
        readers: LogReaders,
        held: HeldBytes,
        newer: NewerFields,
        callers: Callers,
        note_refused: Refused,
    ) -> None:
        self._log, self._track, self._clock = served.log, served.track, served.clock
        self._outbox, self._readers = outbox, readers
        self._held, self._held_stops = held, HeldBytes(_STOPS_OF_ONE_BYTES, _STOPS_OF_ALL_BYTES)
        site, unit = served.site.name, served.unit
        self._newer = newer
        self._commands, self._callers, self._note_refused = CommandCache(server, note_refused), callers, note_refused
        self._forged = Refusals()
        self._log_key = keys.log(site, unit.name)
        self._sweeps = bus.declare_publisher(session, keys.sweep(site, unit.name), Sweep)
        self.status = bus.StatePublisher(session, keys.unit_status(site, unit.name), UnitStatus)
        self._rivals = Rivals(session, self.status.key, UnitStatus, lambda status: status.gateway or "?")
        session.declare_queryable(self._log_key, self._on_log_query, complete=True)
        session.declare_queryable(keys.rpc(site, unit.name, keys.ANY), self._on_command, complete=True)
        if isinstance(unit.pose, PoseKey):
            session.declare_subscriber(keys.pose(site, unit.name), self._on_pose)
        self._alive = session.liveliness().declare_token(keys.alive(site, unit.name))

    def publish(self, record: bytes) -> None:
        """Publish a committed sweep."""
        self._outbox.post(lambda: self._sweeps.put(record))

    def report(self, status: UnitStatus) -> None:
        """Publish the unit's status, and in it who else serves the unit."""
        if others := self._rivals.listed():
            alarm = f"another gateway serves it too ({others}): take it out of one site file"
            status.detail = "; ".join(filter(None, (alarm, status.detail)))
        self._outbox.post(lambda: self.status.put(status))

    @property
    def commands_refused(self) -> int:
        """Commands that were refused here: too many under way, another one's request_id, unreadable, unsigned."""
        return self._commands.refused + self._forged.count

    def _on_pose(self, sample: zenoh.Sample) -> None:
        payload = sample.payload.to_bytes()
        try:
            pose = bounds.decode(Pose, payload)
        except BoundsError:
            self._track.refused += 1
        else:
            self._newer.note(pose, payload)
            utc_s = _time_of(pose, sample)
            now_s = time.monotonic()
            time_s = now_s if utc_s is None else utc_s - self._clock.look().utc_offset_s
            if time_s > now_s + _MOST_AHEAD_S:
                self._track.refused += 1
                return
            pose.ClearField("time")  # a sweep has its own
            self._track.add(time_s, pose)

    def _on_log_query(self, query: zenoh.Query) -> None:
        name = query.attachment.to_bytes()[:LONGEST_NAME].decode(errors="replace") if query.attachment else ""
        answer = partial(self._answer_from_log, query)
        late = partial(_refuse, query, _TOO_LATE)
        if not self._readers.submit(name, self._log_key, answer, late, _size_bytes(query)):
            query.drop()  # an error reply might wait, on Zenoh's own thread

    def _answer_from_log(self, query: zenoh.Query, most: int) -> None:
        with query:
            try:
                records = read_records(self._log, query.parameters.get, most)
            except (LogError, ValueError) as error:
                query.reply_err(str(error))
            else:
                query.reply(self._log_key, records, encoding=bus.encoding(LogRecords))

    def _on_command(self, query: zenoh.Query) -> None:
        payload, size_bytes = query.payload.to_bytes() if query.payload else b"", _size_bytes(query)
        attached = query.attachment.to_bytes() if query.attachment else b""
        request_id = ""
        try:
            request = bounds.decode(CommandRequest, payload)
            request_id = request.request_id
            name = keys.parse_rpc(str(query.key_expr))  # a wildcard commands nobody
            who = self._callers.who(attached, str(query.key_expr), payload)
        except (BoundsError, CallerError, KeyFormatError) as error:
            self._forged.note(str(query.key_expr), error)
            why = str(error)
            command = str(query.key_expr).rpartition("/")[2]
            self._note_refused(command, request_id, caller.claimed(attached), why)
            self._say_refused(query, size_bytes, why)
            return
        self._newer.note(request, payload)
        held = self._held_stops if name == STOP else self._held
        refusal = held.hold(who.name, size_bytes)
        if refusal:
            self._commands.refused += 1
            self._note_refused(name, request_id, who, refusal)
            self._say_refused(query, size_bytes, refusal)
            return

        reply = self._commands.carry_out(name, request, who)
        reply.add_done_callback(lambda done: self._answer(held, who.name, size_bytes, partial(_reply, query, done)))

    def _say_refused(self, query: zenoh.Query, size_bytes: int, why: str) -> None:
        """In words, if there are not too many to be said."""
        refusal = self._held.hold(_REFUSED, size_bytes)
        if refusal:
            query.drop()
        else:
            self._answer(self._held, _REFUSED, size_bytes, partial(_refuse, query, why))

    def _answer(self, held: HeldBytes, client: str, size_bytes: int, answer: Callable[[], None]) -> None:
        """Have a query that is held answered soon."""

        def put() -> None:
            held.let_go(client, size_bytes)
            answer()

        if not self._outbox.post(put):
            held.let_go(client, size_bytes)


def _size_bytes(query: zenoh.Query) -> int:
    parts = (query.payload, query.attachment)
    return sum(len(part) for part in parts if part is not None) + len(str(query.parameters))


def _refuse(query: zenoh.Query, why: str) -> None:
    with query:
        query.reply_err(why)


def _reply(query: zenoh.Query, reply: "Future[CommandReply]") -> None:
    with query:
        query.reply(query.key_expr, reply.result().SerializeToString(), encoding=bus.encoding(CommandReply))


def _time_of(pose: Pose, sample: zenoh.Sample) -> float | None:
    """When the unit was there (UTC): as the tracker says, else as stamped on the way; None if nobody says."""
    if pose.HasField("time"):
        return pose.time.ToNanoseconds() * 1e-9
    return sample.timestamp.get_time().timestamp() if sample.timestamp else None
