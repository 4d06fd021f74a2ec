"""The updates of several units at once, by the gateways that serve them."""

import queue
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import zenoh

from noctule import awake
from noctule.campaign.campaign import Candidate
from noctule.client import Client
from noctule.errors import BusError, NoctuleError, NotServedError
from noctule.messages_pb2 import CommandReply, CommandRequest, UnitStatus

ASK_AGAIN_S = 2.0  # where another update of the unit is under way

_NOT_WELL = (
    UnitStatus.STATE_UNSPECIFIED,
    UnitStatus.STATE_DISCONNECTED,
    UnitStatus.STATE_LOADER,
    UnitStatus.STATE_FAULT,
)


@dataclass(frozen=True)
class Done:
    """A unit's update is over; ``error`` says why it failed, ``detail`` what was done."""

    unit: str
    error: str
    detail: str = ""


@dataclass(frozen=True)
class Update:
    """What each unit is given: the image, whose version is ``version``.

    The gateway's reply must come ``within_s``, and ``served_within_s`` after that the unit must run the version.
    """

    image: bytes
    version: str
    force: bool
    within_s: float
    served_within_s: float


def candidates(client: Client, named: Sequence[str]) -> list[Candidate]:
    """The site's units, or those ``named``. Raises NotServedError: one that no gateway serves, or none at all."""
    alive = client.units()
    statuses = {status.unit: status for status in client.unit_statuses()}
    units = list(dict.fromkeys(named)) or sorted(alive | statuses.keys())
    if not units:
        raise NotServedError(f"site {client.site!r} has no units on the bus: start its gateway")
    return [_candidate(unit, unit in alive, statuses.get(unit)) for unit in units]


def _candidate(unit: str, is_alive: bool, status: UnitStatus | None) -> Candidate:
    if status is None or not is_alive:
        return Candidate(unit, status.firmware if status else "", away="no gateway serves it")
    if status.state == UnitStatus.STATE_DISCONNECTED:
        return Candidate(unit, status.firmware, away=status.detail or "its gateway has no line to it")
    # The version of an application that does not run says nothing.
    return Candidate(unit, "" if status.state == UnitStatus.STATE_LOADER else status.firmware)


class UnitUpdates:
    """Updates units of ``client``'s site; the statuses that come by say how a unit fares after its update."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._changed = threading.Condition()
        self._latest: dict[str, UnitStatus] = {}
        client.on_unit_status(self._note)

    def update(self, units: Sequence[str], update: Update) -> Iterator[Done]:
        """Update ``units`` at the same time, and say of each when it is done.

        When the caller stops asking, the gateways go on with the updates under way.
        """
        done: queue.Queue[Done] = queue.Queue()
        for unit in units:
            # A daemon: an operator's Ctrl-C is not to wait for it.
            threading.Thread(
                target=lambda unit=unit: done.put(self._update_one(unit, update)), name=f"update {unit}", daemon=True
            ).start()
        for _ in units:
            yield awake.get(done)

    def _update_one(self, unit: str, update: Update) -> Done:
        try:
            reply = self._command(unit, update)
        except (NoctuleError, zenoh.ZError) as error:
            return Done(unit, str(error))
        if not reply.done:
            return Done(unit, reply.error)
        return Done(unit, self._not_well(unit, update), reply.detail)

    def _command(self, unit: str, update: Update) -> CommandReply:
        until_s = time.monotonic() + update.within_s
        while True:
            request = CommandRequest(image=update.image, force=update.force)
            left_s = until_s - time.monotonic()
            if left_s <= 0:
                raise BusError(f"another update of the unit is not over after {update.within_s:g} s")
            reply = self._client.command(unit, "update", request, left_s)
            if not reply.under_way:
                return reply
            time.sleep(ASK_AGAIN_S)

    def _note(self, status: UnitStatus) -> None:
        with self._changed:
            self._latest[status.unit] = status
            self._changed.notify_all()

    def _not_well(self, unit: str, update: Update) -> str:
        """What is wrong with a unit that was updated; empty when it is served and runs the version."""

        def is_well() -> bool:
            status = self._latest.get(unit)
            return status is not None and status.firmware == update.version and status.state not in _NOT_WELL

        with self._changed:
            if self._changed.wait_for(is_well, update.served_within_s):
                return ""
            status = self._latest.get(unit, UnitStatus())
        seen = (
            f"{UnitStatus.State.Name(status.state).removeprefix('STATE_').lower()}, {status.firmware or 'no version'}"
        )
        detail = f": {status.detail}" if status.detail else ""
        return (
            f"updated, but {update.served_within_s:g} s later it is not served with {update.version} ({seen}){detail}"
        )
