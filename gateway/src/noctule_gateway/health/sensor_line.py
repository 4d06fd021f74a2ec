"""The echo line fails at nearly every bearing: never rises, never falls, or answers before any sound can be back.

A sound sensor's line fails at no more than one reading in a hundred, so that four of five by chance is beyond all
counting; a fault that comes and goes over less of the sweep is left to the unit's own counter.
"""

from noctule import messages_pb2 as messages
from noctule_gateway.health.readings import Readings
from noctule_gateway.health.suspicion import Suspicion

_LEAST_SHARE = 0.8
_LEAST_READINGS = 4
_EVIDENCE = 30.0

_KINDS = {
    messages.READING_STATUS_NO_SENSOR: (messages.FAULT_KIND_NO_SENSOR, "the echo line never rises"),
    messages.READING_STATUS_STUCK_HIGH: (messages.FAULT_KIND_STUCK_HIGH, "the echo line does not come down"),
    messages.READING_STATUS_TOO_EARLY: (messages.FAULT_KIND_TOO_EARLY, "the echo line pulses before sound can be back"),
}


def suspicions(sweep: Readings) -> list[Suspicion]:
    """The failure that most of the readings tell, or all failures together name the commonest."""
    counts = {status: sweep.status.count(status) for status in _KINDS}
    failed = sum(counts.values())
    if failed < max(_LEAST_READINGS, _LEAST_SHARE * len(sweep.status)):
        return []
    kind, words = _KINDS[max(counts, key=lambda status: counts[status])]
    return [Suspicion(kind, _EVIDENCE, words)]
