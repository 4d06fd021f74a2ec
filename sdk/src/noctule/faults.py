"""The faults of units in words, wherever they are shown."""

from noctule.messages_pb2 import FaultKind, UnitFault


def word(kind: int) -> str:
    """TURNED as ``turned``; one of a newer gateway by its number."""
    if kind not in FaultKind.values():
        return f"fault {kind} of a newer gateway"
    return FaultKind.Name(kind).removeprefix("FAULT_KIND_").lower().replace("_", " ")


def sentence(fault: UnitFault) -> str:
    """What was found, since when, how sure, and what to do. It does not change while the fault lasts."""
    since = f"{fault.since.ToDatetime():%Y-%m-%d %H:%M} UTC" if fault.HasField("since") else "before the clock was set"
    return f"{word(fault.kind)}: {fault.words} (since {since}, {fault.confidence:.0%} sure); {fault.advice}"
