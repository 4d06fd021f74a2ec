"""Sweeps that their gateway had found a fault in, and those just before them, which it could not know of yet."""

from collections.abc import Iterable
from dataclasses import dataclass

from noctule.faults import word
from noctule.messages_pb2 import Sweep


@dataclass(frozen=True)
class Suspect:
    """Sweeps ``first`` to ``last`` of a log, which came before their fault had a name."""

    log_id: str
    first: int
    last: int
    reason: str

    def has(self, sweep: Sweep) -> bool:
        """The sweep is one of them."""
        return sweep.log_id == self.log_id and self.first <= sweep.log_sequence <= self.last


def suspects(sweeps: Iterable[Sweep]) -> list[Suspect]:
    """What ``sweeps`` say of those before them."""
    return [
        Suspect(
            one.log_id,
            max(one.log_sequence - one.suspect_before, 1),
            one.log_sequence - 1,
            f"of the sweeps just before unit {one.unit!r} was found faulty ({reason(one)})",
        )
        for one in sweeps
        if one.log_id and one.suspect_before and one.log_sequence > 1
    ]


def reason(sweep: Sweep) -> str:
    """Its faults in words; empty where it has none."""
    return ", ".join(map(word, sweep.faults))
