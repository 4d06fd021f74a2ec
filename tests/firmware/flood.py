"""A line that is never silent: garbage, and requests that want answers, at the full 115200 baud."""

from random import Random

from firmware.stepped_unit import SteppedUnit
from worst_case import BURST_S, burst

from noctule_gateway.wire.frames import Sweep


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
