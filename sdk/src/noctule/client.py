"""A site on the bus, as any service sees it: messages as they come, the present state, a unit's log, and commands."""

import logging
import uuid
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from time import monotonic, sleep
from types import TracebackType
from typing import Self, TypeVar

import zenoh
from google.protobuf.message import Message

from noctule import bus, caller, keys, tls
from noctule.answers import all_answers, answers, error_text, no_answer
from noctule.delivery import Delivery
from noctule.errors import BusError, KeyFormatError, NotServedError, TlsError
from noctule.intake import Intake
from noctule.messages_pb2 import (
    CommandReply,
    CommandRequest,
    Contour,
    Cursor,
    Features,
    GridTile,
    LogRecords,
    Pose,
    ServiceStatus,
    Sweep,
    UnitStatus,
)
from noctule.states import StateReader
from noctule.subscription import Declared, Subscription
from noctule.unit_reader import UnitReader
from noctule.unit_records import sift

QUERY_TIMEOUT_S = 5.0
REJOIN_S = 3.0  # a gateway tries a router that was restarted each second
_LOOK_AGAIN_S = 0.2

M = TypeVar("M", bound=Message)
LogReply = Future[zenoh.Sample | None]

_log = logging.getLogger(__name__)


class Client:
    """One site on the bus. Use it in a ``with`` statement, or close() it: an open session keeps the process alive.

    Callbacks get decoded messages, one at a time, on one thread of the client. A subscription lasts until the client is
    closed or the returned subscription undeclared. The on_... of a state also deliver the present one, if there is one,
    and again the one that is present after an outage of the bus, if it is another.
    A message that does not fit its key or the bounds of its fields is refused: it is counted, and its key logged once.
    """

    def __init__(
        self,
        site: str,
        connect: Sequence[str] = (),
        session: zenoh.Session | None = None,
        queue_length: int = 10_000,
        tls_folder: Path | None = None,
    ) -> None:
        """Join ``site`` over the routers ``connect``, waiting until one answers, or over the caller's ``session``.

        ``tls_folder`` is as in ``bus.open_session``; by its key commands are signed, with the caller's session too.
        """
        self.site = keys.name(site, "site")
        self.session = bus.open_session(connect, tls_folder=tls_folder) if session is None else session
        self._owns_session, self._tls_folder = session is None, tls_folder
        self._name = str(self.session.zid())  # by which a gateway tells its clients apart, to serve each in its turn
        self._delivery = Delivery(f"noctule-{site}", queue_length)
        self._intake = Intake()
        self._subscriptions: dict[Subscription, None] = {}  # in the order of their making
        self._pose_publishers: dict[str, zenoh.Publisher] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End all subscriptions and the session, unless that is the caller's."""
        for subscription in list(self._subscriptions):
            subscription.undeclare()
        for publisher in self._pose_publishers.values():
            publisher.undeclare()
        self._pose_publishers.clear()
        self._delivery.close()
        if self._owns_session:
            self.session.close()

    def counters(self) -> dict[str, int]:
        """How many messages were ``delivered``, ``refused``, ``dropped`` (callbacks were slow) or ``failed`` in one.

        ``newer`` had fields of a newer version, which were ignored.
        """
        return self._delivery.counters() | {"refused": self._intake.refusals.count, "newer": self._intake.newer.count}

    # ---- Messages as they come ------------------------------------------------------------------------------------

    def on_sweep(self, callback: Callable[[Sweep], None], unit: str = keys.ANY) -> Subscription:
        """Sweeps as they are published; some may be missed. A service that must have them all uses a LogFollower."""
        return self._on(keys.sweep(self.site, unit), Sweep, callback)

    def on_pose(self, callback: Callable[[str, Pose], None], unit: str = keys.ANY) -> Subscription:
        """Poses of units that are tracked, each with the name of its unit."""

        def deliver(sample: zenoh.Sample) -> bool:
            # A pose names no unit, its key does.
            return self._deliver(Pose, lambda pose: callback(_unit_of(sample), pose), sample)

        return self._subscribe(keys.pose(self.site, unit), deliver)

    def on_contour(self, callback: Callable[[Contour], None]) -> Subscription:
        """The site's contour, and each new one."""
        return self._on_state(keys.contour(self.site), Contour, callback)

    def on_features(self, callback: Callable[[Features], None]) -> Subscription:
        """The feature points of the mapper's last update, and of each new one."""
        return self._on_state(keys.features(self.site), Features, callback)

    def on_grid(self, callback: Callable[[GridTile], None]) -> Subscription:
        """The tiles of the reliability grid, and each again when it has changed."""
        return self._on_state(keys.grid(self.site), GridTile, callback)

    def on_unit_status(self, callback: Callable[[UnitStatus], None]) -> Subscription:
        """The status of each unit, and each new one."""
        return self._on_state(keys.unit_status(self.site, keys.ANY), UnitStatus, callback)

    def on_service_status(self, callback: Callable[[ServiceStatus], None]) -> Subscription:
        """The status of each service, and each new one."""
        return self._on_state(keys.service_status(self.site, keys.ANY), ServiceStatus, callback)

    def on_alive(self, callback: Callable[[str, bool], None]) -> Subscription:
        """Each unit's name with True when a gateway serves it (at once where one does), False when none does."""

        def deliver(sample: zenoh.Sample) -> bool:
            name = self._alive_unit(sample)
            if name is not None:
                callback(name, sample.kind == zenoh.SampleKind.PUT)
            return name is not None

        subscriber = self.session.liveliness().declare_subscriber(
            keys.alive(self.site, keys.ANY), lambda sample: self._delivery.put(partial(deliver, sample)), history=True
        )
        return self._keep(subscriber)

    # ---- The present ----------------------------------------------------------------------------------------------

    def contour(self) -> Contour | None:
        """The site's newest contour, or None where no mapper has one. Raises BusError."""
        contours = self._ask_all(keys.contour(self.site), Contour)
        return max(contours, key=lambda contour: contour.time.ToNanoseconds(), default=None)

    def unit_statuses(self) -> list[UnitStatus]:
        """The last status of every unit from each gateway that serves it. Raises BusError."""
        return self._ask_all(keys.unit_status(self.site, keys.ANY), UnitStatus)

    def service_statuses(self) -> list[ServiceStatus]:
        """The last status of every service. Raises BusError."""
        return self._ask_all(keys.service_status(self.site, keys.ANY), ServiceStatus)

    def units(self) -> set[str]:
        """The names of the units that a gateway serves at this moment.

        Raises SilenceError: the router did not say within QUERY_TIMEOUT_S, nor when it was asked again.
        """
        ask = partial(self.session.liveliness().get, keys.alive(self.site, keys.ANY), timeout=QUERY_TIMEOUT_S)
        found = answers(ask, f"which units of site {self.site!r} are served")
        return {name for name in map(self._alive_unit, found) if name is not None}

    # ---- A unit's log and commands --------------------------------------------------------------------------------

    def log(self, unit: str, from_sequence: int, max: int = 500) -> LogRecords | None:
        """Up to ``max`` records of a unit's log from ``from_sequence`` on, or None where no gateway serves the unit.

        Records that don't fit their log or the bounds are left out and counted as refused.
        Raises BusError: the gateway gave an error or was silent for QUERY_TIMEOUT_S.
        """
        records = self.unsifted_log(unit, from_sequence, max)
        if records is not None:
            sifted = sift(records, unit, from_sequence - 1)
            for sequence, reason in sifted.refused.items():
                self._intake.refusals.note(keys.log(self.site, unit), f"record {sequence}: {reason}")
            del records.sweeps[:]
            records.sweeps.extend(sifted.sound)
        return records

    def unsifted_log(self, unit: str, from_sequence: int, max: int = 500) -> LogRecords | None:
        """The same with all records as they came, unchecked, so that a LogFollower knows which ones it passes over."""
        return self.log_records(self.ask_log(unit, from_sequence, max).result())

    def ask_log(self, unit: str, from_sequence: int, max: int) -> LogReply:
        """Ask a unit's log without waiting. The future gets its first reply, or None where no gateway serves the unit.

        It gets BusError where there is only an error, as after QUERY_TIMEOUT_S. Its callbacks run on Zenoh's thread.
        Raises ZError where the session is closed.
        """
        selector = f"{keys.log(self.site, unit)}?from={from_sequence};max={max}"
        future, errors = LogReply(), list[str]()

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.err is not None:
                errors.append(error_text(reply.err))
            elif not future.done():
                future.set_result(reply.ok)

        def on_end() -> None:
            if not future.done() and errors:
                future.set_exception(no_answer(selector, errors[-1], QUERY_TIMEOUT_S))
            elif not future.done():
                future.set_result(None)

        # Any other handler has a thread for each question.
        handler = zenoh.handlers.Callback(on_reply, on_end, indirect=False)
        none = zenoh.ConsolidationMode.NONE
        self.session.get(selector, handler, timeout=QUERY_TIMEOUT_S, consolidation=none, attachment=self._name)
        return future

    def log_records(self, reply: zenoh.Sample | None) -> LogRecords | None:
        """A log's reply, its records unchecked. Raises BusError where it can't be decoded."""
        return self._intake.decode(LogRecords, reply, but=("sweeps",)) if reply is not None else None

    def history(self, unit: str, from_sequence: int = 1) -> Iterator[Sweep]:
        """A unit's log in order, from the log sequence ``from_sequence`` or the oldest record held, to its head.

        Read in pages of 500 sweeps. Records that fit neither their log nor the bounds are left out, and the log names
        them. Raises NotServedError: no gateway serves the unit, or it went away in between; BusError: the gateway gave
        an error, was silent for QUERY_TIMEOUT_S, or began a new log in between.
        """
        first = self.unsifted_log(unit, from_sequence, max=1)
        if first is None:
            raise self._not_served(unit)
        begin = max(from_sequence, first.tail, 1)
        if begin > first.head:
            return
        page: list[Sweep] = []
        cursor = Cursor(unit=unit, log_id=first.log_id, log_sequence=begin - 1)
        reader, more = UnitReader(unit, cursor, page.extend, Counter()), True
        while more:
            records = self.unsifted_log(unit, reader.cursor.log_sequence + 1)
            if records is None:
                raise self._not_served(unit)
            more = reader.read(records)
            if reader.cursor.log_id != first.log_id:
                raise BusError(f"unit {unit!r} began a new log while the old one was read: read it again from 1")
            yield from page
            page.clear()

    def command(self, unit: str, name: str, request: CommandRequest, timeout_s: float) -> CommandReply:
        """Have a unit carry out a command; ``done`` and ``error`` of the reply tell how it went.

        A request without an id gets one; to try again use the same id, then it is carried out once at most.
        Where no unit of the site is served, this one is waited for, up to REJOIN_S: the router may have been restarted.
        Raises NotServedError: no gateway serves the unit; TlsError: the folder can't be used; BusError: there was no
        reply within ``timeout_s``, or we may not command it; KeyFormatError: a name that is none, or a wildcard.
        """
        if not request.request_id:
            request.request_id = uuid.uuid4().hex
        key = keys.rpc(self.site, keys.name(unit, "unit"), keys.name(name, "command"))  # never several at once
        payload = request.SerializeToString()
        attachment = caller.attachment(self._name, self._tls_folder, key, payload)
        reply = next(self._ask(key, payload, timeout_s, attachment), None)
        if reply is None:
            if unit not in self._rejoined(unit):
                raise self._not_served(unit)
            reply = next(self._ask(key, payload, timeout_s, attachment), None)  # it may have come since
        if reply is None:
            raise BusError(f"unit {unit!r} was not given the command: the routers let only operators command units")
        return self._intake.decode(CommandReply, reply)

    def _rejoined(self, unit: str) -> set[str]:
        """The units that are served: at once where some are, else as soon as ``unit`` is, or after REJOIN_S."""
        until_s, units = monotonic() + REJOIN_S, self.units()
        if units:
            return units  # a mistyped name costs no wait
        while unit not in units and monotonic() < until_s:
            sleep(_LOOK_AGAIN_S)
            units = self.units()
        return units

    def publish_pose(self, unit: str, pose: Pose) -> None:
        """Publish where a tracked unit is."""
        if unit not in self._pose_publishers:
            self._pose_publishers[unit] = bus.declare_publisher(self.session, keys.pose(self.site, unit), Pose)
        self._pose_publishers[unit].put(pose.SerializeToString())

    def _not_served(self, unit: str) -> NotServedError:
        try:
            identity = tls.chosen(self._tls_folder)
        except TlsError:  # its folder was altered after the session began, which does not matter here
            identity = None
        hidden = f", or ask whether the routers let {identity.common_name} see it" if identity else ""
        return NotServedError(
            f"no gateway serves unit {unit!r} of site {self.site!r}: start it, or correct the name{hidden}"
        )

    # ---- How ------------------------------------------------------------------------------------------------------

    def _on(self, key: str, message_type: type[M], callback: Callable[[M], None]) -> Subscription:
        return self._subscribe(key, partial(self._deliver, message_type, callback))

    def _on_state(self, key: str, message_type: type[M], callback: Callable[[M], None]) -> Subscription:
        state = StateReader(partial(self._intake.accepted, message_type), callback)  # of the delivery's thread
        subscriber = self._declare_subscriber(key, state.on_published)
        try:
            for sample in self._ask(key):
                self._put(state.on_present, sample)
        except BusError as error:
            _log.warning("the present of %s is not known until it is next published: %s", key, error)
        # A state that was published during an outage comes by no subscription. Its publisher, which answers for it,
        # appears again when the bus is back: that is when to ask.
        querier = self.session.declare_querier(key)
        again = partial(self._ask_again, key, state)
        listener = querier.declare_matching_listener(
            lambda status: self._delivery.put(again) if status.matching else None
        )
        return self._keep(subscriber, listener, querier)

    def _ask_again(self, key: str, state: StateReader[M]) -> bool:
        state.asking()

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                self._put(state.on_present, reply.ok)

        self.session.get(key, on_reply, timeout=QUERY_TIMEOUT_S, consolidation=zenoh.ConsolidationMode.NONE)
        return False  # nothing was delivered yet

    def _deliver(self, message_type: type[M], callback: Callable[[M], None], sample: zenoh.Sample) -> bool:
        """Hand the message to ``callback``; False where it is refused."""
        message = self._intake.accepted(message_type, sample)
        if message is not None:
            callback(message)
        return message is not None

    def _alive_unit(self, sample: zenoh.Sample) -> str | None:
        try:
            return _unit_of(sample)
        except KeyFormatError as error:
            self._intake.refusals.note(str(sample.key_expr), error)
            return None

    def _subscribe(self, key: str, deliver: Callable[[zenoh.Sample], bool]) -> Subscription:
        return self._keep(self._declare_subscriber(key, deliver))

    def _declare_subscriber(self, key: str, deliver: Callable[[zenoh.Sample], bool]) -> zenoh.Subscriber:
        return self.session.declare_subscriber(key, lambda sample: self._put(deliver, sample))

    def _put(self, deliver: Callable[[zenoh.Sample], bool], sample: zenoh.Sample) -> None:
        self._delivery.put(partial(deliver, sample), len(sample.payload))

    def _keep(self, *parts: Declared) -> Subscription:
        subscription = Subscription(*parts, forget=lambda ended: self._subscriptions.pop(ended, None))
        self._subscriptions[subscription] = None
        return subscription

    def _ask_all(self, key: str, message_type: type[M]) -> list[M]:
        accepted = [self._intake.accepted(message_type, reply) for reply in self._ask(key)]
        return [message for message in accepted if message is not None]

    def _ask(
        self, selector: str, payload: bytes | None = None, timeout_s: float = QUERY_TIMEOUT_S, attachment: bytes = b""
    ) -> Iterator[zenoh.Sample]:
        return all_answers(self.session, selector, payload, timeout_s, attachment or self._name)


def _unit_of(sample: zenoh.Sample) -> str:
    return keys.parse_unit(str(sample.key_expr)).unit
