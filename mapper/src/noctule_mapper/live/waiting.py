"""Changes of the window that the map has not taken yet."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.window import Identity


@dataclass
class Waiting:
    """What is to be taken off the map and then put on it, and since when. What leaves before it was put on never is,
    so that no more waits than the window holds, however long a fit takes or however much comes from a log at once.
    """

    left: list[Identity] = field(default_factory=list)
    entered: dict[Identity, SweepReadings] = field(default_factory=dict)
    since_s: float | None = None

    def add(self, left: Sequence[Identity], entered: Sequence[SweepReadings], now_s: float) -> None:
        """Add changes that came at ``now_s`` (monotonic)."""
        self.left += [identity for identity in left if self.entered.pop(identity, None) is None]
        self.entered.update((readings.identity, readings) for readings in entered)
        self.since_s = now_s if self.since_s is None else self.since_s

    def __len__(self) -> int:
        return len(self.left) + len(self.entered)
