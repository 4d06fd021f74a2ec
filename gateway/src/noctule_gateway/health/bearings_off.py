"""Whether bearings are off in the last sweeps: slipped, with play, or turned, whichever is the likeliest."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees

from noctule import messages_pb2 as messages
from noctule_gateway.health.alignment import Aligned, turned, with_play
from noctule_gateway.health.course import slipped
from noctule_gateway.health.offsets import Table
from noctule_gateway.health.suspicion import Suspicion

_GOOD = 1.6  # nats an echo, no more than so much worse than usual: one angle or two explain the sweeps
_FOREIGN_ECHO = 2.6  # worse than so much: nothing is explained, nor by slips
_LEAST_GAIN = 30.0  # of a bearing that is off over none
_SLIPS_NATS, _PLAY_NATS = 8.0, 10.0  # over one angle, since they have more freedom
_SLIPS_SHARE = 0.5  # of the bearings that are off: what stands in an open door changes fewer
_LEAST_OFF = 4  # half steps between bearings, from the least angle to the largest, of slips and of play
_CLEARLY_NATS, _CLEARLY_SHARE, _CLEARLY_OFF = 25.0, 0.4, 3  # less will do where slips lead by so much
_TO_SLIP = 3  # sweeps, in which a turned or moved unit gains nothing by slips
_TO_PLAY = 3  # sweeps, of which one is of the other sense
_TO_TURN = 4  # sweeps that are asked together: within these a motor that loses steps shows it


@dataclass(frozen=True)
class BearingsOff:
    """What explains the sweeps, by how many nats more than the past; ``is_sure`` is False where more sweeps have to say
    which of the three it is. ``turned_by`` is in half steps between bearings, 0 where it was not turned. ``fits_well``:
    about as well as the past usually does.
    """

    suspicion: Suspicion
    is_sure: bool
    turned_by: int
    fits_well: bool

    @property
    def gain(self) -> float:
        """In nats over the past."""
        return self.suspicion.evidence


def bearings_off(tables: Sequence[Table], usual_fit: float, heard_share: float) -> BearingsOff | None:
    """None where none of the three explains the sweeps. Of the past, ``heard_share`` is the mean share of bearings that
    answer; ``usual_fit`` is in nats a reading, without echoes that are alone.
    """
    one, two = turned(tables), with_play(tables)
    plays = two.between >= _LEAST_OFF and two.gain - one.gain >= _PLAY_NATS
    others = max(one.gain, two.gain)
    many = slipped(tables, one, least_gain=others + _SLIPS_NATS)
    slips = many is not None and _is_a_course(many, others)
    best = many if many is not None and slips else two if plays else one
    worse = (usual_fit - best.fit) / heard_share
    if best.gain < _LEAST_GAIN or worse > _FOREIGN_ECHO:
        return None
    good, sweeps = (_FOREIGN_ECHO, _TO_SLIP) if slips else (_GOOD, _TO_PLAY if plays else _TO_TURN)
    told = _slipped if slips else _with_play if plays else _turned
    if worse > good and best.since <= len(tables) - _TO_TURN:
        return None  # it has had its time
    is_sure = worse <= good and best.since <= len(tables) - sweeps and (slips or many is None)
    return BearingsOff(told(best, tables[0]), is_sure, one.off[0] if told is _turned else 0, worse <= _GOOD)


def _is_a_course(many: Aligned, others: float) -> bool:
    """Bearings are off by angles that differ by enough; ``others`` is what one angle or two gain."""
    least, share = (_CLEARLY_OFF, _CLEARLY_SHARE) if many.gain >= others + _CLEARLY_NATS else (_LEAST_OFF, _SLIPS_SHARE)
    return many.between >= least and many.share >= share


def _slipped(found: Aligned, table: Table) -> Suspicion:
    off_deg = degrees(max(map(abs, found.off)) * table.step_rad / 2)
    words = f"bearings are off by up to {off_deg:.0f} degrees, by different angles within one sweep"
    return Suspicion(messages.FAULT_KIND_SLIPPED, found.gain, words)


def _with_play(found: Aligned, table: Table) -> Suspicion:
    between_deg = degrees(found.between * table.step_rad / 2)
    words = f"bearings differ by {between_deg:.0f} degrees between the two senses of turning"
    return Suspicion(messages.FAULT_KIND_PLAY, found.gain, words)


def _turned(found: Aligned, table: Table) -> Suspicion:
    turned_deg = degrees(found.off[0] * table.step_rad / 2)
    way = "anticlockwise" if turned_deg > 0 else "clockwise"
    return Suspicion(
        messages.FAULT_KIND_TURNED, found.gain, f"it was turned {way} by about {abs(turned_deg):.0f} degrees"
    )
