"""What goes wrong in a history, drawn from a seed: faults that overlap, as data."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import chain
from random import Random

UNITS = ("u1", "u2", "u3")

# How often each is drawn, beside the others.
WEIGHTS = {
    ("gateway", "killed"): 4,
    ("gateway", "frozen"): 4,
    ("gateway", "disk full"): 3,
    ("mapper", "killed"): 2,
    ("mapper", "frozen"): 4,
    ("mapper", "disk full"): 3,
    ("router", "killed"): 2,
    ("router", "replaced"): 2,
    ("router", "frozen"): 3,
    ("relay", "killed"): 1,
    ("relay", "frozen"): 2,
    ("units", "without power"): 1,
    ("line", "pulled"): 4,
    ("line", "hung"): 3,
    ("line", "noisy"): 3,
    ("clock", "set"): 3,
}
MOST_FAULTS = 6
STARTS_WITHIN_S = 3.0
LONG_S = (8.0, 14.0)  # around the lease of a session, 10 s
SHORT_S = (0.2, 3.0)
MOST_HOURS = 12.0


@dataclass(frozen=True)
class Fault:
    """From ``start_s`` on, for ``duration_s``, something is wrong with ``target``.

    ``hours`` is by how much the clock is set; at the end it is set back by as much.
    """

    start_s: float
    duration_s: float
    target: str
    kind: str
    hours: float = 0.0

    @property
    def end_s(self) -> float:
        return self.start_s + self.duration_s

    def __str__(self) -> str:
        by = f" by {self.hours:+.1f} h" if self.hours else ""
        return f"{self.start_s:.1f} to {self.end_s:.1f} s: {self.target} {self.kind}{by}"


History = Sequence[Fault]


def draw(seed: int) -> History:
    """The history of ``seed``: two to six faults that begin within three seconds."""
    random = Random(seed)
    return sorted((_fault(random) for _ in range(random.randint(2, MOST_FAULTS))), key=lambda fault: fault.start_s)


def moments_s(history: History) -> list[float]:
    """When something begins or ends, in order."""
    return sorted(set(chain.from_iterable((fault.start_s, fault.end_s) for fault in history)))


def at(history: History, time_s: float) -> list[Fault]:
    """What is wrong from ``time_s`` on."""
    return [fault for fault in history if fault.start_s <= time_s < fault.end_s]


def to_json(history: History) -> str:
    """A history as read_json() takes it."""
    return json.dumps([asdict(fault) for fault in history])


def read_json(text: str) -> History:
    """The history that to_json() wrote."""
    return [Fault(**fault) for fault in json.loads(text)]


def _fault(random: Random) -> Fault:
    target, kind = random.choices(list(WEIGHTS), list(WEIGHTS.values()))[0]
    if target == "line":
        target = random.choice(UNITS)
    duration_s = random.uniform(*(LONG_S if random.random() < 0.05 else SHORT_S))
    hours = random.uniform(-MOST_HOURS, MOST_HOURS) if target == "clock" else 0.0
    return Fault(round(random.uniform(0.0, STARTS_WITHIN_S), 2), round(duration_s, 2), target, kind, round(hours, 2))
