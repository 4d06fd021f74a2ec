"""The bytes of queries that a gateway holds until they are answered: of each client and of all they have a limit."""

import threading
from collections import Counter

MOST_OF_ONE_BYTES = 2**22  # an update has an image of up to 2**20
MOST_OF_ALL_BYTES = 2**25  # on a bus without certificates a client can go by any number of names
_OVERHEAD_BYTES = 2**9  # that a query takes besides


class HeldBytes:
    """Counts them; from any thread."""

    def __init__(self, most_of_one_bytes: int = MOST_OF_ONE_BYTES, most_of_all_bytes: int = MOST_OF_ALL_BYTES) -> None:
        self._most_of_one_bytes, self._most_of_all_bytes = most_of_one_bytes, most_of_all_bytes
        self._lock = threading.Lock()
        self._of: Counter[str] = Counter()
        self._of_all = 0

    def hold(self, client: str, size_bytes: int) -> str:
        """Hold a query of that size; one query alone always has room. Returns why it can't be held, empty if it is."""
        size_bytes += _OVERHEAD_BYTES
        with self._lock:
            for held, most, whose in (
                (self._of[client], self._most_of_one_bytes, f"other queries of {client or 'clients without a name'}"),
                (self._of_all, self._most_of_all_bytes, "other queries"),
            ):
                if held and held + size_bytes > most:
                    return f"{whose} have {held} of {most} bytes that may wait: ask again when they are answered"
            self._of[client] += size_bytes
            self._of_all += size_bytes
        return ""

    def let_go(self, client: str, size_bytes: int) -> None:
        """The query is answered."""
        size_bytes += _OVERHEAD_BYTES
        with self._lock:
            self._of_all -= size_bytes
            self._of[client] -= size_bytes
            if not self._of[client]:
                del self._of[client]
