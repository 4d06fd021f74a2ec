"""What speaks for a sweep being the expected unit's, and its acknowledgement and all orders reaching no other.

Plugs can be exchanged while all lines stay open. From protocol 3 on each SWEEP, ACK and order names the unit; those of
protocol 2 do not. So such a sweep is taken, and acknowledged, only soon after a HELLO of the expected unit, to which
the unit sends the sweep once more. And an order goes to such a unit only soon after a HELLO.
"""

from noctule_gateway.wire.frames import PROTOCOL, Ack, Ack2, AnySweep, Hello, Sweep

VOUCHES_FOR_S = 1.0  # long enough for the sweep and its commit, too short to change plugs

_NAMED_SINCE = 3  # the protocol in which SWEEP, ACK and orders name the unit


def addressee_of(hello: Hello) -> tuple[int, int] | None:
    """Serial number and life by which orders name the unit; None if it knows no such orders."""
    return (hello.serial, hello.life) if hello.protocol >= _NAMED_SINCE else None


class Voucher:
    """The latest HELLO of the expected unit; times are those that go into the link."""

    def __init__(self) -> None:
        self._protocol = PROTOCOL
        self._addressee: tuple[int, int] | None = None
        self._until_s = 0.0

    def greeted(self, hello: Hello, now_s: float) -> None:
        """The expected unit has said ``hello``."""
        self._protocol = hello.protocol
        self._addressee = addressee_of(hello)
        self._until_s = now_s + VOUCHES_FOR_S

    def withdrawn(self) -> None:
        """The line is another one, or another unit is on it."""
        self._until_s = 0.0

    def speaks_for(self, sweep: AnySweep, now_s: float) -> bool:
        """``sweep``, which names no other unit, is the expected one's, and the unit there now is the expected one."""
        return self._names_unit(sweep) or now_s < self._until_s

    @property
    def addressee(self) -> tuple[int, int] | None:
        """Serial number and life by which orders name the unit; None if they do not."""
        return self._addressee

    def speaks_for_orders(self, now_s: float) -> bool:
        """An order, or a repeat of it, that goes now is carried out by no other unit than the expected one."""
        return self._addressee is not None or now_s < self._until_s

    def acknowledgement(self, sweep: AnySweep) -> Ack | Ack2:
        """What tells the unit that ``sweep`` is safe."""
        if isinstance(sweep, Sweep) and self._names_unit(sweep):
            return Ack(sweep.boot, sweep.sequence, sweep.serial, sweep.life)
        return Ack2(sweep.boot, sweep.sequence)

    def _names_unit(self, sweep: AnySweep) -> bool:
        """Both ``sweep`` and its acknowledgement do. A unit may go back to protocol 2 with named sweeps in its ring."""
        return isinstance(sweep, Sweep) and self._protocol >= _NAMED_SINCE
