"""A line that is never silent: garbage, and requests that want answers, at the full 115200 baud."""

from random import Random

from firmware.stepped_unit import SteppedUnit

from noctule_gateway.wire.codec import encode
from noctule_gateway.wire.frames import AskStatus, Sweep

BURST_S = 0.1
BURST_BYTES = 1130  # of the 1152 that the line takes in that time: acknowledgements must get through too
LONGEST_GARBAGE_BYTES = 200


def burst(noise: Random) -> bytes:
    """What fills the line for ``BURST_S``."""
    data = b""
    while len(data) < BURST_BYTES:
        garbage = noise.randbytes(noise.randrange(LONGEST_GARBAGE_BYTES)).replace(b"\0", b"\1")
        data += encode(AskStatus(noise.randrange(1, 256))) + garbage + b"\0"
    return data[:BURST_BYTES]


def flood(unit: SteppedUnit, duration_s: float, noise: Random) -> list[Sweep]:
    """Keep the line to the unit full for so long; the sweeps that it sends meanwhile.

    Acknowledgements are lost as everything else is, so each burst ends with one for the last sweep.
    """
    sweeps: list[Sweep] = []
    end_s = unit.now_s + duration_s
    while unit.now_s < end_s:
        unit.send_bytes(burst(noise))
        unit.run(BURST_S)
        sweeps += unit.take(Sweep)
        for made in sweeps[-1:]:
            unit.acknowledge(made)
    unit.send_bytes(b"\0")
    return sweeps
