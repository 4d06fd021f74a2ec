"""A serial line that corrupts, loses and repeats bytes and delivers late, by the dice of a seed. It reads no clock."""

from collections import deque
from dataclasses import dataclass
from random import Random


@dataclass(frozen=True)
class Faults:
    """Chances per byte, and the longest delay per write."""

    corrupted: float = 0.0
    lost: float = 0.0
    doubled: float = 0.0
    delay_s: float = 0.0


class BadLine:
    """One direction of a line; bytes keep their order."""

    def __init__(self, faults: Faults, seed: int) -> None:
        self._faults = faults
        self._random = Random(seed)
        self._under_way: deque[tuple[float, bytes]] = deque()
        self._last_s = 0.0

    def write(self, data: bytes, now_s: float) -> None:
        """Send ``data``."""
        self._last_s = max(self._last_s, now_s + self._random.uniform(0, self._faults.delay_s))
        self._under_way.append((self._last_s, b"".join(map(self._suffer, data))))

    def read(self, now_s: float) -> bytes:
        """What has arrived by now."""
        arrived = b""
        while self._under_way and self._under_way[0][0] <= now_s:
            arrived += self._under_way.popleft()[1]
        return arrived

    def _suffer(self, byte: int) -> bytes:
        if self._random.random() < self._faults.corrupted:
            byte ^= self._random.randrange(1, 256)  # any other value
        if self._random.random() < self._faults.lost:
            return b""
        return bytes([byte] * (2 if self._random.random() < self._faults.doubled else 1))
