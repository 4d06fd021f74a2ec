"""What a query of a log is answered: LogRecords whose sweeps are the log's own bytes.

Parsing 500 sweeps and writing them again would take twice as long as reading them, and no unit's thread runs meanwhile.
"""

from collections.abc import Callable

from noctule.messages_pb2 import LogGap, LogRecords
from noctule_gateway.log.log_reader import LogSlice
from noctule_gateway.log.sweep_log import SweepLog

MAX_RECORDS = 500
MAX_REPLY_BYTES = 2**20
MAX_GAPS = 1000
_LONGEST_REASON = 1000
_MOST_DIGITS = 18  # a count that SQLite holds
_SWEEPS_TAG = LogRecords.SWEEPS_FIELD_NUMBER << 3 | 2  # a field with a length: protobuf.dev, Encoding
_MORE = 0x80


def read_records(log: SweepLog, parameter: Callable[[str], str | None], most: int = MAX_RECORDS) -> bytes:
    """The LogRecords that ``from=N;max=M`` asks for, ``most`` of them. Raises ValueError and LogError."""
    first, asked = (_number(name, parameter(name), default) for name, default in (("from", 1), ("max", most)))
    return encoded(log.read(first, min(asked, most), MAX_REPLY_BYTES))


def encoded(found: LogSlice) -> bytes:
    """The slice as LogRecords on the wire: fields of a message may follow each other in any order."""
    gaps = [
        LogGap(first=gap.first, last=gap.last, damaged=gap.damaged, reason=gap.reason[:_LONGEST_REASON])
        for gap in found.gaps[:MAX_GAPS]
    ]
    about = LogRecords(log_id=found.log_id, head=found.head, tail=found.tail, gaps=gaps).SerializeToString()
    return b"".join((about, *(part for record in found.records for part in (_before(len(record)), record))))


def _before(length: int) -> bytes:
    """Tag and length of a sweep: seven bits a byte, the lowest first."""
    made = bytearray((_SWEEPS_TAG,))
    while length >= _MORE:
        made.append(length & 0x7F | _MORE)
        length >>= 7
    made.append(length)
    return bytes(made)


def _number(name: str, text: str | None, default: int) -> int:
    if text is None:
        return default
    if not text.isdecimal() or len(text) > _MOST_DIGITS:
        raise ValueError(f"{name}={text} is not a count: ask with from=N;max=M")
    return int(text)
