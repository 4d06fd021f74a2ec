"""How far the motor turns before the sensor follows, by one edge of the home switch met from both sides."""

from collections.abc import Sequence
from statistics import median

from noctule.messages_pb2 import Measurement
from noctule_gateway.measure.edges import Edges, failure
from noctule_gateway.measure.figures import bad, good
from noctule_gateway.wire.frames import Calibrate, Mechanics

NAME = "backlash_half_steps"

_SAME = 2  # half steps: an edge is found to one from either side
_MOST = 128  # firmware/README.md, CALIBRATE
_SCATTER = 3


def measurement(passes: Sequence[Mechanics], calibration: Calibrate) -> Measurement:
    """The play over these passes of the edge, and what to do where it is not what the unit goes by."""
    for each in passes:
        if (why := failure(each)) is not None:
            return bad(NAME, why)
    found = [play_of(each) for each in passes]
    known = [each for each in found if each is not None]
    if not known or len(known) < len(found):
        return bad(NAME, "the home switch did not open and close: check it, its wire and the motor")
    play = round(median(known))
    words = f"{play} half steps of play"
    if max(known) - min(known) > _SCATTER:
        told = ", ".join(map(str, known))
        return bad(NAME, f"it differs from time to time ({told}): the motor loses steps, or the switch is loose")
    if play > _MOST:
        return bad(NAME, f"{words}, more than the {_MOST} it can be told: fasten the sensor on its shaft", play)
    if abs(play - calibration.backlash) > _SAME:
        todo = f"calibrate --backlash-half-steps {play}, then store"
        return bad(NAME, f"{words}, and the unit goes by {calibration.backlash}: {todo}", play)
    return good(NAME, f"{words}, as the unit goes by", play)


def play_of(mechanics: Mechanics) -> int | None:
    """By one pass; None if the switch was not seen both ways. Without play, its edges are a half step apart."""
    edges = Edges.of(mechanics)
    if not edges.up or not edges.down:
        return None
    return max(0, edges.up[0] - edges.down[-1] - 1)
