"""A measured figure with its verdict, as the bus is told it."""

from noctule.messages_pb2 import Measurement


def good(name: str, words: str, value: float | None = None) -> Measurement:
    """As it should be."""
    return Measurement(name=name, value=value, verdict=Measurement.VERDICT_GOOD, words=words)


def bad(name: str, words: str, value: float | None = None) -> Measurement:
    """Not as it should be; ``words`` say what to do."""
    return Measurement(name=name, value=value, verdict=Measurement.VERDICT_BAD, words=words)


def unknown(name: str, words: str, value: float | None = None) -> Measurement:
    """Could not be told; ``words`` say why."""
    return Measurement(name=name, value=value, verdict=Measurement.VERDICT_UNKNOWN, words=words)
