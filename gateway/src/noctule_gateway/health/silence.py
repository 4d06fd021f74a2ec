"""No echo where there used to be: at no bearing, or over a wide arc.

Of a bearing that answered in a share h of the past the next reading is silent with chance 1 - h, independently: the
chance of the whole is the product, and its logarithm the evidence. 12 nats, twice in a row, come by chance once in
e^24 = 2.6e10 sweeps. A door that opens, or a wardrobe that leaves, silences one reflector or two within some 60
degrees. So an arc is 90 degrees wide or wider, or 60 where it held three reflectors.
"""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

from noctule import messages_pb2 as messages
from noctule.messages_pb2 import READING_STATUS_NO_ECHO, READING_STATUS_UNSPECIFIED
from noctule_gateway.health.likelihood import elsewhere_nats
from noctule_gateway.health.marks import runs_of
from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings
from noctule_gateway.health.suspicion import Suspicion

_LEAST_NATS = 12.0
_ARC_RAD = math.radians(90.0)
_ARC_OF_MARKS_RAD, _MARKS = math.radians(60.0), 3  # what changes in a room takes one mark or two
_LEAST_USUAL = 8  # bearings of an arc that usually answer
_USUAL_SHARE = 0.7
_MOST_FALSE = 0.04  # of readings: a deaf sensor may still pick up noise
_LEAST_READINGS = 4
_AS_BEFORE_M = 0.025


def suspicions(sweep: Readings, past: Past | None, before: Readings | None = None) -> list[Suspicion]:
    """What the sweep shows. ``past`` is None where none can be asked; ``before`` is the sweep before, where known."""
    listened = [n for n, one in enumerate(sweep.status) if _listened(one) or not math.isnan(sweep.range_m[n])]
    if len(listened) < _LEAST_READINGS:
        return []
    echoes = len(sweep.heard)
    if past is None:
        words = f"no echo at any of {len(listened)} bearings"
        return [] if echoes else [Suspicion(messages.FAULT_KIND_NO_ECHO_ANYWHERE, _LEAST_NATS, words)]
    silent = [n for n in listened if math.isnan(sweep.range_m[n])]
    nats = _nats(past, silent)
    usual = sum(share >= _USUAL_SHARE for share in past.heard_share)
    arc = _arc([sweep] if before is None else [before, sweep], past, listened)
    # A false echo falls into the past's range by chance once in eighty: such echoes are true ones, beside a silent arc.
    deaf = echoes <= _MOST_FALSE * len(listened) and nats >= _LEAST_NATS and not _hears_a_reflector(sweep)
    if deaf and not (arc and _as_before(sweep, past)):
        words = (
            f"{_echoes(echoes)} at {len(listened)} bearings, where {usual} used to answer; "
            "or it was moved to where nothing answers, which sounds the same"
        )
        return [Suspicion(messages.FAULT_KIND_SILENT, nats, words)]
    if not echoes:
        words = f"no echo at any of {len(listened)} bearings"
        return [Suspicion(messages.FAULT_KIND_NO_ECHO_ANYWHERE, nats, words)]
    return arc


def _hears_a_reflector(sweep: Readings) -> bool:
    """Neighbours hear the same. Two false echoes do in one sweep of 800: 60 pairs, 4 % of readings false within 4 m."""
    return any(abs(a - b) <= _AS_BEFORE_M for a, b in pairwise(sweep.range_m))


def _as_before(sweep: Readings, past: Past) -> bool:
    """A reading hears what the past heard there."""
    return any(abs(sweep.range_m[n] - past.median_m[n]) <= _AS_BEFORE_M for n in sweep.heard)


def _arc(sweeps: Sequence[Readings], past: Past, listened: Sequence[int]) -> list[Suspicion]:
    """The last sweep's widest arc without any echo, if it used to answer, and what is heard beside it in all of
    ``sweeps`` is as before.
    """
    sweep = sweeps[-1]
    runs: list[list[int]] = [[]]
    for number in listened:
        if math.isnan(sweep.range_m[number]):
            runs[-1].append(number)
        elif runs[-1]:
            runs.append([])
    widest = max(runs, key=len)
    usual = [n for n in widest if past.heard_share[n] >= _USUAL_SHARE]
    nats = _nats(past, usual)
    if len(usual) < _LEAST_USUAL or nats < _LEAST_NATS:
        return []
    marks = sum(set(run) <= set(widest) for run in runs_of(past))
    least_rad = _ARC_OF_MARKS_RAD if marks >= _MARKS else _ARC_RAD
    if sweep.bearing_rad[usual[-1]] - sweep.bearing_rad[usual[0]] < least_rad:
        return []
    beside = set(listened) - set(widest)
    if not past.agrees(sweeps, widest) or sum(_elsewhere_nats(each, past, beside) for each in sweeps) > 0:
        return []
    first, last = (round(math.degrees(sweep.bearing_rad[n])) for n in (widest[0], widest[-1]))
    return [Suspicion(messages.FAULT_KIND_ARC_SILENT, nats, f"no echo any more from {first} to {last} degrees")]


def _elsewhere_nats(sweep: Readings, past: Past, beside: Iterable[int]) -> float:
    """How much likelier the readings ``beside`` an arc are in another place that answers as often as this one."""
    return sum(elsewhere_nats(past, n, sweep.range_m[n]) for n in beside)


def _nats(past: Past, silent: Sequence[int]) -> float:
    """Minus the logarithm of the chance of this silence."""
    return -sum(math.log1p(-past.heard_share[n]) for n in silent)


def _listened(status: int) -> bool:
    return status in (READING_STATUS_NO_ECHO, READING_STATUS_UNSPECIFIED)


def _echoes(count: int) -> str:
    return {0: "no echo", 1: "one echo"}.get(count, f"{count} echoes")
