"""Sweeps that came live and are none of the unit's log: anybody on a bus without certificates can publish one."""

import logging
from collections import Counter
from collections.abc import Sequence

from noctule.messages_pb2 import LogRecords, Sweep

_MOST = 64  # live sweeps that are held until the log is asked, and sweeps of the log to compare later ones with

_log = logging.getLogger(__name__)


class Strangers:
    """Counts such sweeps of one unit in ``counts["refused"]``, and logs the first.

    A gateway publishes what is in its log. So what came before the log was asked and is not in its answer is a
    stranger's.
    """

    def __init__(self, unit: str, counts: Counter[str]) -> None:
        self._unit, self._counts = unit, counts
        self._live: dict[tuple[str, int, int], bool] = {}  # log_id, log_sequence, hash: whether the log was asked since
        self._own: dict[int, int] = {}  # hashes of the log's newest sweeps, by log_sequence
        self._told = False

    def note(self, sweep: Sweep) -> None:
        """A sweep came live. Of a flood only the first are looked at."""
        if len(self._live) < _MOST:
            self._live.setdefault((sweep.log_id, sweep.log_sequence, _hash(sweep)), False)

    def ask(self) -> None:
        """The log is asked now."""
        self._live = dict.fromkeys(self._live, True)

    def compare(self, records: LogRecords, sweeps: Sequence[Sweep], read_to: int) -> None:
        """Compare with the log's answer, with its ``sweeps``, by which it is read up to ``read_to``."""
        self._own |= {sweep.log_sequence: _hash(sweep) for sweep in sweeps[-_MOST:]}
        while len(self._own) > _MOST:
            del self._own[next(iter(self._own))]
        for one in [one for one, asked in list(self._live.items()) if asked]:
            log_id, sequence, content = one
            if log_id == records.log_id and read_to < sequence <= records.head:
                continue  # compared when the log has been read so far
            del self._live[one]
            beyond = sequence > records.head
            if log_id == records.log_id and (beyond or content != self._own.get(sequence, content)):
                self._refuse(sequence, records)

    def forget(self) -> None:
        """The unit has another log."""
        self._own.clear()

    def _refuse(self, sequence: int, records: LogRecords) -> None:
        self._counts["refused"] += 1
        if not self._told:
            self._told = True
            _log.error(
                "unit %s: what came live as sweep %d of log %s is not in that log, which ends at %d, and is not taken: "
                "somebody else publishes on the unit's key, from which certificates keep strangers",
                self._unit,
                sequence,
                records.log_id,
                records.head,
            )


def _hash(sweep: Sweep) -> int:
    return hash(sweep.SerializeToString(deterministic=True))
