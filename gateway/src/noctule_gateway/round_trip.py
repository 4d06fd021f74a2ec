"""The round trip of a CLOCK request, with the time that the bytes themselves take on the line taken out."""

from noctule_gateway.clock import TICK_S, Exchange
from noctule_gateway.codec import encode
from noctule_gateway.frames import Clock

_BYTE_S = 10 / 115200  # 8N1
_ANSWER_S = len(encode(Clock(1, 0, 0))) * _BYTE_S


class RoundTrip:
    """The latest request: asked(), then exchange() with its answer."""

    def __init__(self) -> None:
        self._asked_s = self._asked_through_s = 0.0

    def asked(self, now_s: float, size_bytes: int) -> None:
        """So many bytes begin to go out, of which the request's are the last."""
        self._asked_s, self._asked_through_s = now_s, now_s + size_bytes * _BYTE_S

    def exchange(self, clock: Clock, now_s: float) -> Exchange:
        """The exchange that the answer ``clock``, whose last byte has just come, completes."""
        sent_s, answered_s = self._asked_through_s, now_s - _ANSWER_S
        if answered_s - sent_s < (clock.sent - clock.received) * TICK_S:
            sent_s, answered_s = self._asked_s, now_s  # a line that is faster than a UART
        return Exchange(sent_s, clock.received, clock.sent, answered_s)
