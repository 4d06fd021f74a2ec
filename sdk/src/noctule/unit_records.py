"""The records in a reply of a unit's log, each checked by itself: one that is spoiled must not hide the others."""

from dataclasses import dataclass

from noctule import bounds
from noctule.errors import BoundsError
from noctule.messages_pb2 import LogRecords, Sweep


@dataclass(frozen=True)
class Sifted:
    """Sweeps in log_sequence order, and why those at other sequences were refused."""

    sound: list[Sweep]
    refused: dict[int, str]


def sift(records: LogRecords, unit: str, after: int) -> Sifted:
    """The records of ``unit``'s log that follow the sequence ``after``.

    A refused record may lie about its sequence, and is taken to follow the record before it, as all in a log do.
    """
    sound: list[Sweep] = []
    refused: dict[int, str] = {}
    last_sound, last = after, max(after, records.tail - 1)
    for sweep in records.sweeps:
        if reason := _fault(sweep, records, unit):
            last = min(last + 1, records.head)
            refused[last] = reason
        elif sweep.log_sequence > last_sound:
            sound.append(sweep)
            last_sound = last = sweep.log_sequence
    taken = {after, *(sweep.log_sequence for sweep in sound)}
    return Sifted(sound, {sequence: reason for sequence, reason in refused.items() if sequence not in taken})


def _fault(sweep: Sweep, records: LogRecords, unit: str) -> str:
    """Why the record can't be one of this log; empty if it can."""
    try:
        bounds.check(sweep)
    except BoundsError as error:
        return str(error)
    if sweep.unit != unit:
        return f"it is a sweep of unit {sweep.unit!r}"
    if sweep.log_id != records.log_id:
        return f"it is a sweep of log {sweep.log_id!r}, and this is log {records.log_id!r}"
    if sweep.log_sequence > records.head:
        return f"its sequence is {sweep.log_sequence}, and the log ends at {records.head}"
    return ""
