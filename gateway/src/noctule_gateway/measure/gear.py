"""How many half steps make a turn of the sensor, by the edges of the home switch that a unit saw over a whole turn.

Going up the switch opens, closes from the other side, and opens again one turn after the first time; going down the
same backwards. The two openings are the same edge in the same sense, so play has no part in their distance.
"""

from collections.abc import Sequence
from statistics import mean
from typing import NamedTuple

from noctule.messages_pb2 import Measurement
from noctule_gateway.measure.edges import Edges, failure
from noctule_gateway.measure.figures import bad, good, unknown
from noctule_gateway.wire.frames import Calibrate, Mechanics
from noctule_gateway.wire.units import HALF_STEPS_PER_TURN, PER_HALF_STEP

NAME = "half_steps_per_turn"

_AGREES = 3.0  # half steps: each edge is found to one
_TAKEN = (3800.0, 4400.0)  # half steps a turn that a unit takes: firmware/README.md, CALIBRATE


class Gear(NamedTuple):
    """A gear that is sold in 28BYJ-48 motors. 64 half steps are a turn of the rotor."""

    words: str
    half_steps_per_turn: float


GEARS = (
    Gear("1/63.684, the usual one", HALF_STEPS_PER_TURN),
    Gear("1/64", 64 * 64),
    Gear("1/16.032", 16.032 * 64),
)
# A unit between two stops or with a short cable turns this much of a circle from its switch at most (degrees).
_STOPPED_DEG = (290.0, 345.0)


def measurement(passes: Sequence[Mechanics], calibration: Calibrate) -> Measurement:
    """The figure, its gear by name, and what to do where it is not what the unit goes by.

    Each pass is a turn up and down; two passes, since lost steps may be as many on one pass's way up as down.
    """
    turns: list[int] = []
    for each in passes:
        if (why := failure(each)) is not None:
            return bad(NAME, why)
        edges = Edges.of(each)
        if len(edges.up) < 3 or len(edges.down) < 3:
            return _blocked(edges)
        turns += [edges.up[2] - edges.up[0], edges.down[0] - edges.down[2]]
    turn = mean(turns)
    if max(turns) - min(turns) > _AGREES:
        told = ", ".join(map(str, turns))
        why = "the motor loses steps, or the switch's line is disturbed"
        return bad(NAME, f"a turn is {told} half steps, up and down by turns: {why}", turn)
    gear = next((each for each in GEARS if abs(turn - each.half_steps_per_turn) <= _AGREES), None)
    named = f"gear {gear.words}" if gear else "no gear known here"
    words = f"{turn:.1f} half steps a turn: {named}"
    if not _TAKEN[0] <= turn <= _TAKEN[1]:
        return bad(NAME, f"{words}: the wrong gear, replace the motor by one of 1/64", turn)
    best = gear.half_steps_per_turn if gear else turn
    present = calibration.half_steps_per_turn / PER_HALF_STEP
    if abs(best - present) > _AGREES:
        todo = f"calibrate --half-steps-per-turn {best:.2f}, then store"
        return bad(NAME, f"{words}, and the unit goes by {present:.2f}: {todo}", turn)
    return good(NAME, f"{words}, as the unit goes by", turn)


def _blocked(edges: Edges) -> Measurement:
    """Something holds the sensor: how far it came tells at least a gear that is another by far."""
    why = "the switch did not close again within a turn: free the sensor, its cable and its stop for a whole turn"
    if not edges.up or not edges.down:
        return bad(NAME, "the home switch did not open and close: check it, its wire and the motor")
    travel = edges.top - edges.down[0]
    for gear in GEARS:
        if _STOPPED_DEG[0] <= travel / gear.half_steps_per_turn * 360 <= _STOPPED_DEG[1]:
            if _TAKEN[0] <= gear.half_steps_per_turn <= _TAKEN[1]:
                return unknown(NAME, f"{why}; {travel} half steps from there to the switch fit a gear of 1/64")
            words = f"{travel} half steps from where it was held to the switch: gear {gear.words}"
            return bad(NAME, f"{words}: the wrong gear, replace the motor by one of 1/64")
    return unknown(NAME, why)
