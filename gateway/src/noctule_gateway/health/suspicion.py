"""What a detector says of one sweep."""

from dataclasses import dataclass

from noctule.messages_pb2 import FaultKind


@dataclass(frozen=True)
class Suspicion:
    """The sweep looks as it does under the fault ``kind``. ``evidence`` is how much likelier it is under that than
    under the past, in nats; ``words`` is what was found, with its figures.
    """

    kind: FaultKind
    evidence: float
    words: str
