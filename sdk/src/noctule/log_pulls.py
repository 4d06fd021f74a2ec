"""Questions to the logs of many units at once, so that a log which does not answer holds up no other."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from enum import Enum

from noctule.messages_pb2 import Cursor, LogRecords

PAGE = 500  # records in a reply
LANES = 8  # questions at once to the logs of one standing


class Standing(Enum):
    """What is known of a log; those of one standing wait for one another, and for no others."""

    NEW = "was never asked"
    ANSWERS = "answered last time"
    FAILS = "did not answer last time"


@dataclass(frozen=True)
class Answer:
    """What became of a question that was asked at ``asked``; no records and no error where nobody serves the unit."""

    unit: str
    asked: Cursor
    records: LogRecords | None = None
    error: BaseException | None = None


class LogPulls:
    """Asks ``ask`` for so many records from a log sequence on, on threads of its own, and calls ``done`` on them."""

    def __init__(self, ask: Callable[[str, int, int], LogRecords | None], done: Callable[[Answer], None]) -> None:
        self._ask, self._done = ask, done
        self._lanes = {
            standing: ThreadPoolExecutor(LANES, thread_name_prefix=f"log pull {standing.name.lower()}")
            for standing in Standing
        }

    def begin(self, unit: str, cursor: Cursor, standing: Standing) -> None:
        """Ask for what follows ``cursor``. Never waits."""
        self._lanes[standing].submit(self._pull, unit, cursor)

    def close(self) -> None:
        """Begin no more questions. Those on their way end with the session, or in seconds."""
        for lane in self._lanes.values():
            lane.shutdown(wait=False, cancel_futures=True)

    def _pull(self, unit: str, cursor: Cursor) -> None:
        try:
            answer = Answer(unit, cursor, self._ask(unit, cursor.log_sequence + 1, PAGE))
        except BaseException as error:  # a panic of Zenoh is no Exception; the follower's thread raises it
            answer = Answer(unit, cursor, error=error)
        self._done(answer)
