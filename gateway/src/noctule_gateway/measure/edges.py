"""The edges of the home switch that a unit saw on its way up and down, and why it saw none."""

from dataclasses import dataclass

from noctule_gateway.wire.frames import Measured, Mechanics

NEEDS_SWITCH = "a unit without a home switch can't measure this: it does not feel its end stop"

_FAILURES: dict[int, str] = {
    Measured.NO_SWITCH: "no home switch was found within a turn: check the switch and the motor's wiring",
    Measured.STAYS_CLOSED: "the home switch does not open: check whether it sticks, its wire, and the motor's wiring",
    Measured.STOPPED: "it was stopped",
}


@dataclass(frozen=True)
class Edges:
    """Half steps of the motor at which the switch changed: opened first on the way up, closed last on the way down.

    ``top`` is where it turned round.
    """

    up: tuple[int, ...]
    down: tuple[int, ...]
    top: int

    @classmethod
    def of(cls, mechanics: Mechanics) -> "Edges":
        """As the unit tells them."""
        up = (mechanics.up_1, mechanics.up_2, mechanics.up_3)[: mechanics.ups]
        down = (mechanics.down_1, mechanics.down_2, mechanics.down_3)[: mechanics.downs]
        return cls(up, down, mechanics.top)


def failure(mechanics: Mechanics) -> str | None:
    """Why the measurement came to nothing; None if it did not."""
    if mechanics.outcome == Measured.DONE:
        return None
    return _FAILURES.get(mechanics.outcome, f"it came to nothing (outcome {mechanics.outcome})")
