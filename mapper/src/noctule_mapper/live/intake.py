"""What comes in: sweeps of the units' logs into the store, those that can be mapped onto the map."""

import logging
from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from noctule.messages_pb2 import Cursor, Sweep
from noctule_mapper.live.config import LiveConfig
from noctule_mapper.live.map_messages import MapProcessError
from noctule_mapper.live.refused import RefusedSweeps
from noctule_mapper.live.store import Change, SweepStore
from noctule_mapper.live.store_file import StoreError
from noctule_mapper.live.troubles import Troubles
from noctule_mapper.readings import faulty
from noctule_mapper.readings.faulty import Suspect
from noctule_mapper.readings.sweep import SweepError, SweepReadings, from_message, identity_of
from noctule_mapper.rerun_view.no_log import NoLog
from noctule_mapper.window import Identity, lasting

if TYPE_CHECKING:
    from noctule_mapper.rerun_view.log import RerunLog

_log = logging.getLogger(__name__)


class SweepIntake:
    """Sweeps on their way into the store and onto the map. ``take`` is given what is to leave the map and what is new
    on it, after it was stored.
    """

    def __init__(
        self,
        config: LiveConfig,
        store: SweepStore,
        log: "RerunLog | NoLog",
        troubles: Troubles,
        take: Callable[[Sequence[Identity], Sequence[SweepReadings]], None],
    ) -> None:
        self._config, self._store, self._log, self._troubles, self._take = config, store, log, troubles, take
        self._refused = RefusedSweeps(log.show_event)
        self._aside = {identity for _, identity, _ in store.sweeps_set_aside()}
        self._counts = Counter(sweeps_taken=0, sweeps_taken_out=0, sweeps_set_aside=len(self._aside))

    def recall(self) -> list[SweepReadings]:
        """What the store holds and can be mapped, at the start; the log and the status say why the rest can't."""
        if self._store.damage:
            self._troubles.begin("store", self._store.damage)
        for unit, identity, reason in self._store.sweeps_set_aside()[-1:]:
            self._tell_set_aside(unit, identity, reason)
        read = [(sweep.unit, self._read(sweep)) for sweep in self._store.sweeps()]
        for unit, found in read:
            self._note(unit, found)
        held = [found for _, found in read if isinstance(found, SweepReadings)]
        for readings in held:
            self._log.recall_sweep(readings)
        return held

    def held(self) -> list[SweepReadings]:
        """What the store holds and can be mapped."""
        read = map(self._read, self._store.sweeps())
        return [found for found in read if isinstance(found, SweepReadings)]

    def deliver(self, sweeps: Sequence[Sweep]) -> None:
        """Take in sweeps of one unit's log, in order: into the store with the cursor, then onto the map."""
        last, suspects = sweeps[-1], faulty.suspects(sweeps)
        cursor = Cursor(unit=last.unit, log_id=last.log_id, log_sequence=last.log_sequence)
        usable = self._usable(sweeps, suspects)
        change = self._commit([sweep for sweep, _ in usable.values()], cursor, suspects)
        self._tell_suspects(last.unit, suspects, change)
        new = [usable[identity_of(sweep)][1] for sweep in change.entered]
        self._take(change.left, new)
        self._counts["sweeps_taken"] += len(sweeps)
        for readings in new:
            self._log.show_sweep(readings)

    def set_aside(self, readings: SweepReadings, error: MapProcessError) -> None:
        """Keep a sweep that broke the map off it, after a restart too."""
        self._store.set_aside(readings.identity, error.reason)
        self._aside.add(readings.identity)
        self._counts["sweeps_set_aside"] += 1
        self._tell_set_aside(readings.unit, readings.identity, error.reason, error)

    def counters(self) -> dict[str, int]:
        """What became of the sweeps."""
        return dict(self._counts) | {"sweeps_unusable": self._refused.count()}

    def detail(self) -> str:
        """Which units' sweeps can't be mapped, and why; empty while all can."""
        return self._refused.detail()

    def _usable(
        self, sweeps: Sequence[Sweep], suspects: Sequence[Suspect]
    ) -> dict[Identity, tuple[Sweep, SweepReadings]]:
        """Those that can be mapped, with their readings, without those that the window would let go of at once: where
        much has gathered in a log, that is nearly all, and to read them costs most of the time. So sweeps that can't be
        mapped are noted where they were read, and not among the others.
        """
        asked = dict[Identity, SweepReadings | SweepError | None]()

        def is_usable(sweep: Sweep) -> bool:
            identity = identity_of(sweep)
            if identity not in asked:
                left_out = identity in self._aside or any(suspect.has(sweep) for suspect in suspects)
                asked[identity] = None if left_out else self._read(sweep)
            return isinstance(asked[identity], SweepReadings)

        kept = lasting(sweeps, is_usable, self._config.window.sweeps_per_place)
        for sweep in sweeps:  # in the log's order, which is not the one in which they were asked for
            if (found := asked.get(identity_of(sweep))) is not None:
                self._note(sweep.unit, found)
        return {
            identity: (sweep, readings)
            for sweep in kept
            if isinstance(readings := asked[identity := identity_of(sweep)], SweepReadings)
        }

    def _tell_suspects(self, unit: str, suspects: Sequence[Suspect], change: Change) -> None:
        """Say which sweeps of the map are taken out of it."""
        for suspect in suspects:
            taken = sum(log_id == suspect.log_id and suspect.first <= n <= suspect.last for log_id, n in change.left)
            self._counts["sweeps_taken_out"] += taken
            if taken:
                text = f"{unit}: sweeps {suspect.first} to {suspect.last} are taken out of the map: {suspect.reason}"
                _log.warning("%s", text)
                self._log.show_event(text, "WARN")

    def _commit(self, sweeps: Sequence[Sweep], cursor: Cursor, suspects: Sequence[Suspect]) -> Change:
        try:
            change = self._store.commit(sweeps, [cursor], suspects)
        except StoreError as error:
            self._troubles.begin("commit", f"{error}; the sweeps wait in the gateways' logs")
            raise
        self._troubles.end("commit", "the mapper's store can be written again")
        return change

    def _read(self, sweep: Sweep) -> SweepReadings | SweepError:
        """The sweep's readings, or why it can't be mapped."""
        try:
            return from_message(sweep, self._config.mapper.sensor)
        except SweepError as error:
            return error

    def _note(self, unit: str, found: SweepReadings | SweepError) -> None:
        """Note for the status whether a sweep of ``unit`` can be mapped."""
        if isinstance(found, SweepError):
            self._refused.refuse(unit, found)
        else:
            self._refused.accept(unit)

    def _tell_set_aside(self, unit: str, identity: Identity, reason: str, error: Exception | None = None) -> None:
        log_id, sequence = identity
        text = (
            f"sweeps that broke the map and are set aside: {self._counts['sweeps_set_aside']}, the last one sweep "
            f"{sequence} of {log_id!r} (unit {unit!r}, {reason}); mapping goes on, please report it"
        )
        self._troubles.begin("set aside", text, error)
