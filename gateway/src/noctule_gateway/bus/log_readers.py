"""The threads that answer queries of logs: each client has one at most, so that a frozen one holds up no other.

A reply to a client that takes nothing waits until Zenoh gives its link up, which is seconds.
"""

import logging
import threading
from collections import deque
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from time import monotonic

from noctule_gateway.bus.held_bytes import HeldBytes
from noctule_gateway.bus.log_reply import MAX_RECORDS

MAX_CLIENTS = 64  # that wait for answers at once
# Waiting queries of one client, without the first of each unit: a reader that waits for its answers has none of these.
MAX_WAITING = 64
CROWD = 16  # from which on a client gets less
REST = 30.0  # between two answers to such a client, in the time that the first took: the gateway has units to serve
LONGEST_REST_S = 0.3  # an answer that took long mostly waited, for the disk or the client, and kept no unit waiting
# Records in such a client's answer: while one is made a unit's sweep waits at each of its twenty steps for Python.
FEW = 20
STALE_AFTER_S = 5.0  # a query that has waited so long is not answered: most clients have given up and ask again
THREADS = 8
LONGEST_NAME = 64

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Query:
    unit: str
    since_s: float
    size_bytes: int
    answer: Callable[[int], object]
    say_late: Callable[[], object]


class LogReaders:
    """Runs ``answer``s, those of one client in their order. What is too much is refused, and ``cut_off`` says whose."""

    def __init__(self, now: Callable[[], float] = monotonic) -> None:
        self.refused = 0
        self._now, self._held = now, HeldBytes()
        self._lock = threading.Lock()
        # Of each client that is being answered
        self._waiting: dict[str, deque[_Query]] = {}
        # The client's refused queries and why the first was, as long as it has others waiting
        self._cut_off: dict[str, tuple[int, str]] = {}
        self._full = False  # a client was refused since one was last done
        self._threads = ThreadPoolExecutor(THREADS, thread_name_prefix="log reader")

    def submit(
        self,
        client: str,
        unit: str,
        answer: Callable[[int], object],
        say_late: Callable[[], object],
        size_bytes: int,
    ) -> bool:
        """Have ``answer`` called soon, with the most records that it may hold; False where it is refused. From any
        thread, never waiting. The query is one for the log of ``unit`` and has ``size_bytes``.

        ``say_late`` is called instead after STALE_AFTER_S: a client that still waits must not think that nobody is
        there.
        """
        client, query = client[:LONGEST_NAME], _Query(unit, self._now(), size_bytes, answer, say_late)
        with self._lock:
            waiting = self._waiting.get(client)
            refusal = self._too_many(waiting, query) or self._held.hold(client, size_bytes)
            if not refusal:
                if waiting is None:
                    self._waiting[client] = deque([query])
                    self._threads.submit(self._answer_next, client)
                else:
                    waiting.append(query)
                return True
            self.refused += 1
            if waiting is None:
                news, self._full = not self._full, True
            else:
                count, why = self._cut_off.get(client, (0, refusal))
                self._cut_off[client] = count + 1, why
                news = not count
        if news:
            _log.warning("a query of client %s for a log is refused: %s", client or "?", refusal)
        return False

    def _too_many(self, waiting: Collection[_Query] | None, query: _Query) -> str:
        """Why there is no place for ``query`` beside those of its client that wait; empty if there is one."""
        if waiting is None:
            return "" if len(self._waiting) < MAX_CLIENTS else f"{MAX_CLIENTS} other clients wait for answers"
        if _excess([*waiting, query]) <= MAX_WAITING:
            return ""
        return f"{len(waiting)} others of it wait: end it, or have it wait for each answer"

    def cut_off(self) -> str:
        """Whose queries are refused now, and why; empty where nobody's are."""
        with self._lock:
            told = [
                f"of {client or 'clients without a name'} ({count}): {why}"
                for client, (count, why) in self._cut_off.items()
            ]
        return f"queries refused: {'; '.join(sorted(told))}" if told else ""

    def close(self) -> None:
        """Answer no more; what is being answered is left to its end."""
        self._threads.shutdown(wait=False, cancel_futures=True)

    def _answer_next(self, client: str) -> None:
        with self._lock:
            query = self._waiting[client].popleft()
            crowded = _excess([query, *self._waiting[client]]) >= CROWD
        begun_s = self._now()
        try:
            if begun_s - query.since_s < STALE_AFTER_S:
                query.answer(FEW if crowded else MAX_RECORDS)
            else:
                query.say_late()
        except Exception:
            _log.exception("a query of client %s was not answered", client)
        self._held.let_go(client, query.size_bytes)
        with self._lock:
            if not self._waiting[client]:
                del self._waiting[client]
                self._cut_off.pop(client, None)
                self._full = False
                return
            rest_s = min(REST * (self._now() - begun_s), LONGEST_REST_S) if crowded else 0.0
        if rest_s:
            later = threading.Timer(rest_s, self._go_on, (client,))
            later.daemon = True
            later.start()
        else:
            self._go_on(client)

    def _go_on(self, client: str) -> None:
        with suppress(RuntimeError):  # closed meanwhile
            self._threads.submit(self._answer_next, client)


def _excess(queries: Collection[_Query]) -> int:
    return len(queries) - len({query.unit for query in queries})
