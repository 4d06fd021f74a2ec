"""Whether a fixed unit still stands and points as it did: turned, slipped, with play, moved, or only too noisy to tell.

The last sweeps are asked together how much likelier they are under each of these than under the past; the likeliest is
named once it leads by enough. A sweep is looked at closely only where it, or the last three, fit the past worse than
usual. What explains the sweeps must then fit about as well as usual, which no change of the room does.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from statistics import median

from noctule import messages_pb2 as messages
from noctule_gateway.health.alignment import (
    Aligned,
    Table,
    shifted_nats,
    slipped,
    stay_fit,
    table_of,
    turned,
    with_play,
)
from noctule_gateway.health.look import Look
from noctule_gateway.health.marks import marks_of
from noctule_gateway.health.noise import NOISY_M, change_m, disagreement_m, scatter_m
from noctule_gateway.health.past import Past
from noctule_gateway.health.shift import Shift, jump_of, motion_of
from noctule_gateway.health.suspicion import Suspicion

_WORSE, _WORSE_OF_THREE = 0.2, 0.15  # nats a reading, than usual: looked at closely
_GOOD, _GOOD_SLIPS = 1.6, 2.0  # nats an echo, no more than so much worse than usual: this explains the sweeps
_BAD = 0.8  # nats a reading, worse than usual: something is wrong
_FOREIGN = 1.2  # worse than usual: this may be another room
_FOREIGN_ECHO = 2.6  # worse than so much: nothing is explained
_LEAST_GAIN = 30.0  # of a bearing that is off over none
_SLIPS_NATS, _PLAY_NATS = 15.0, 15.0  # over one angle, since they have more freedom
_SLIPS_FIT = 0.3  # nats an echo, that slips have to fit better than one angle
_SLIPS_SHARE = 0.5  # of the bearings that are off: what stands in an open door changes fewer
_LEAST_OFF = 4  # half steps between bearings, from the least angle to the largest, of slips and of play
_LEAST_SHIFT_GAIN = 3.5
_TO_PLAY = 3  # sweeps, of which one is of the other sense
_TO_TURN = 4  # sweeps that are asked together: within these a motor that loses steps shows it
_TO_SHIFT = 2
_KEPT_USUAL, _LEAST_USUAL = 20, 3
_LEAST_STABLE = 8  # bearings: fewer tell nothing of the place
_LEAST_ENTRIES = 4  # of a past, from which on a fit to it is a usual one


@dataclass
class _Seen:
    look: Look
    fit: float  # nats a reading, than usual
    table: Table | None = None


class PlaceWatch:
    """Remembers the last sweeps, and how well sweeps usually fit. ``strange``: the last one fits nothing known."""

    def __init__(self, usual: Sequence[float] = ()) -> None:
        self.usual: deque[float] = deque(usual, _KEPT_USUAL)
        self.strange = False
        self._last: deque[_Seen] = deque(maxlen=_TO_TURN)

    def suspicions(self, look: Look, past: Past) -> list[Suspicion]:
        """What the last sweeps show; the past is asked, not changed."""
        self.strange = False
        if len(self.usual) < _LEAST_USUAL or len(past.stable()) < _LEAST_STABLE:
            return []
        self._last.append(_Seen(look, stay_fit(look, past) - median(self.usual)))
        fits = [seen.fit for seen in self._last][-3:]
        self.strange = fits[-1] < -_BAD
        shift = self._shift(past)
        if fits[-1] >= -_WORSE and sum(fits) >= -_WORSE_OF_THREE * 3:
            return self._shifted(shift) if shift is not None and not shift.moved_m else []
        off = self._bearings_off(past, shift)
        if off is not None:
            return off
        if noisy := self._noisy(look, past):
            return [noisy]
        if shift is not None:
            return self._shifted(shift)
        return self._elsewhere(look)

    def learn_from(self, look: Look, past: Past) -> None:
        """The sweep is well, and not in the past yet: this is how well one usually fits."""
        if len(past) >= _LEAST_ENTRIES:
            self.usual.append(stay_fit(look, past))

    def _bearings_off(self, past: Past, shift: Shift | None) -> list[Suspicion] | None:
        """Slipped, with play or turned. Empty where one of them explains the sweeps, but more sweeps have to say which;
        None where none does.
        """
        tables = []
        for seen in self._last:
            seen.table = seen.table or table_of(seen.look, past)
            if seen.table is None:
                return None
            tables.append(seen.table)
        one, two = turned(tables), with_play(tables)
        plays = two.between >= _LEAST_OFF and two.gain - one.gain >= _PLAY_NATS
        many = slipped(tables, least_gain=max(one.gain, two.gain) + _SLIPS_NATS)
        heard = sum(past.heard_share) / len(past.heard_share)
        slips = (
            many is not None
            and many.between >= _LEAST_OFF
            and many.share >= _SLIPS_SHARE
            and many.fit - one.fit >= _SLIPS_FIT * heard
        )
        best = many if many is not None and slips else two if plays else one
        worse = (median(self.usual) - best.fit) / heard
        if best.gain < _LEAST_GAIN or worse > _FOREIGN_ECHO:
            return None
        if shift is not None and self._shift_gain(past, shift) > best.gain:
            return None
        self.strange = True
        good, sweeps = (_GOOD_SLIPS, 1) if slips else (_GOOD, _TO_PLAY if plays else _TO_TURN)
        if worse > good or best.since > len(tables) - sweeps:
            return []
        if slips:
            return [_slipped(best, tables[0])]
        return [_with_play(best, tables[0]) if plays else _turned(best, tables[0])]

    def _shift(self, past: Past) -> Shift | None:
        """The motion or jump of the last two sweeps, whichever is likelier, if it is likely."""
        looks = [seen.look for seen in self._last][-_TO_SHIFT:]
        if len(looks) < _TO_SHIFT:
            return None
        marks, measured = marks_of(looks, past), looks[-1].air_measured
        found = [each for each in (motion_of(marks, measured), jump_of(marks, measured)) if each is not None]
        best = max(found, key=lambda each: each.gain, default=None)
        if best is None or best.gain < _LEAST_SHIFT_GAIN:
            return None
        if not best.moved_m:  # each of them has to show it: the half of one that was moved looks like a jump
            alone = [jump_of(marks_of([look], past), measured) for look in looks]
            if any(each is None or each.gain < _LEAST_SHIFT_GAIN for each in alone):
                return None
        return best

    def _shift_gain(self, past: Past, shift: Shift) -> float:
        """Of the last sweeps, as the gains of bearings that are off."""
        gain = 0.0
        for seen in self._last:
            longer_m = [shift.longer(b, r) for b, r in zip(seen.look.bearing_rad, past.median_m, strict=True)]
            gain += max(0.0, shifted_nats(seen.look, past, longer_m) - stay_fit(seen.look, past) * len(longer_m))
        return gain

    def _shifted(self, shift: Shift) -> list[Suspicion]:
        self.strange = True
        kind = messages.FAULT_KIND_MOVED if shift.moved_m else messages.FAULT_KIND_RANGES_JUMPED
        words = f"{shift.words}: {shift.fitting} marks fit that" if shift.moved_m else shift.words
        return [Suspicion(kind, shift.gain, words)]

    def _elsewhere(self, look: Look) -> list[Suspicion]:
        """Nothing fits, and the sweep repeats the one before."""
        if len(self._last) < 2 or max(seen.fit for seen in list(self._last)[-2:]) >= -_FOREIGN:
            return []
        change = change_m(look, self._last[-2].look, range(len(look.range_m)))
        if change is None or change >= NOISY_M:
            return []
        words = "its sweeps repeat themselves and no longer fit its past: it was moved elsewhere, or the room changed"
        return [Suspicion(messages.FAULT_KIND_MOVED, 10.0, words)]

    def _noisy(self, look: Look, past: Past) -> Suspicion | None:
        scatter, disagreement = scatter_m(look, past), disagreement_m(look, past)
        if scatter is None or disagreement is None or min(scatter, disagreement) < NOISY_M:
            return None
        change = None if len(self._last) < 2 else change_m(look, self._last[-2].look, past.stable())
        if change is not None and change < NOISY_M:
            return None
        self.strange = True
        words = f"ranges scatter by {100 * scatter:.0f} cm and do not repeat themselves"
        return Suspicion(messages.FAULT_KIND_TOO_NOISY, 15.0, words)


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
