"""Whether a fixed unit still stands and points as it did: turned, slipped, with play, moved, or only too noisy to tell.

The last sweeps are asked together how much likelier they are under each of these than under the past; the likeliest is
named once it leads by enough, and not where a change in one arc of the room explains them better. A sweep is looked at
closely only where it, or the last three, fit the past worse than usual, or where its marks show a shift by far. What
explains the sweeps must then fit about as well as usual, which no change of the room does.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median

from noctule import messages_pb2 as messages
from noctule_gateway.health.bearings_off import bearings_off
from noctule_gateway.health.changed_arc import ARC_FREEDOM, arc_nats, repeated_nats, stands
from noctule_gateway.health.likelihood import shifted_nats, stay_fit, usual_fit
from noctule_gateway.health.marks import marks_of
from noctule_gateway.health.noise import LEAST_M, NOISY_M, change_m, disagreement_m, scatter_m
from noctule_gateway.health.offsets import Table, table_of
from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings
from noctule_gateway.health.shift import Shift, as_far, gain_of, jump_of, motion_of
from noctule_gateway.health.suspicion import Suspicion

_WORSE, _WORSE_OF_THREE = 0.2, 0.15  # nats a reading, than usual: looked at closely
_BAD = 0.8  # nats a reading, worse than usual: something is wrong
_FOREIGN = 1.2  # worse than usual: this may be another room
_LEAST_SHIFT_GAIN = 3.5
_CLEAR_MOTION_GAIN = 8.0  # where the readings fit the past as usual
_MARK_NATS = 2.0  # only to choose: of motion and jump the one that explains more marks
_JUMP_LEADS = 3.0  # nats, over a motion: where both explain the same marks, it does so by 4
_ASKED, _TO_SHIFT = 4, 2  # sweeps together
_KEPT_USUAL, _LEAST_USUAL = 20, 3
_LEAST_STABLE = 8  # bearings: fewer tell too little
_LEAST_REPEATED = 2  # echoes: of two false ones both come again by chance in one sweep of a million
_FORGOTTEN_AFTER = 3  # sweeps in a row that fit as usual: what was shown before is over
_LEAST_ENTRIES = 4  # of a past, from which on a fit to it is a usual one


@dataclass
class _Seen:
    sweep: Readings
    fit: float  # nats a reading, than usual
    table: Table | None = None


class PoseWatch:
    """Remembers the last sweeps, and how well sweeps usually fit. ``strange``: the last one fits nothing known;
    ``stands``: nor does it, but the unit has not been carried elsewhere.
    """

    def __init__(self, usual: Sequence[float] = ()) -> None:
        self.usual: deque[float] = deque(usual, _KEPT_USUAL)
        self.strange = self.stands = False
        self._known: Shift | None = None  # the last one that was shown, until it is over
        self._well = 0  # sweeps in a row that fit as usual and show nothing
        self._last: deque[_Seen] = deque(maxlen=_ASKED)

    @property
    def last(self) -> Readings | None:
        """The sweep that was taken in last."""
        return self._last[-1].sweep if self._last else None

    def take(self, sweep: Readings, past: Past) -> bool:
        """Remember the sweep, to judge it and the next ones; False while the past tells too little."""
        self.strange = self.stands = False
        if len(self.usual) < _LEAST_USUAL or len(past.stable()) < _LEAST_STABLE:
            return False
        self._last.append(_Seen(sweep, stay_fit(sweep, past) - median(self.usual)))
        return True

    def suspicions(self, past: Past) -> list[Suspicion]:
        """What the last sweeps show, up to the one that was taken in just now; the past is asked, not changed."""
        sweep = self._last[-1].sweep
        fits = [seen.fit for seen in self._last][-3:]
        self.strange = fits[-1] < -_BAD
        shift = self._shift(past)
        if fits[-1] >= -_WORSE and sum(fits) >= -_WORSE_OF_THREE * 3:
            return self._shifted(shift) if shift is not None and _is_clear(shift) else self._as_usual()
        self._well = 0
        off = self._bearings_off(past, shift)
        if off is not None:
            return off
        if noisy := self._noisy(sweep, past):
            return [noisy]
        if shift is not None:
            return self._shifted(shift)
        known = self._still_shifted(sweep, past)
        if known is not None:
            return self._shifted(known)
        return self._elsewhere(sweep, past)

    def learn_from(self, sweep: Readings, past: Past) -> None:
        """The sweep is well, and not in the past yet: this is how well one usually fits. The past changes next,
        so the tables made from it are dropped.
        """
        for seen in self._last:
            seen.table = None
        if len(past) >= _LEAST_ENTRIES:
            self.usual.append(stay_fit(sweep, past))

    def _bearings_off(self, past: Past, shift: Shift | None) -> list[Suspicion] | None:
        """Empty where bearings are off, but more sweeps have to say how; None where they are not."""
        tables = []
        for seen in self._last:
            seen.table = seen.table or table_of(seen.sweep, past)
            if seen.table is None:
                return None
            tables.append(seen.table)
        off = bearings_off(tables, usual_fit(past), past.mean_heard_share)
        if off is None or (shift is not None and self._shift_gain(past, shift) > off.gain):
            return None
        if shift is not None and shift.moved_m and not off.fits_well:
            return None  # slips can explain nearly anything a little, marks that fit a motion only a motion
        sweeps = [seen.sweep for seen in self._last]
        if off.gain < arc_nats(sweeps, past) - ARC_FREEDOM:
            return None
        if off.suspicion.kind == messages.FAULT_KIND_SLIPPED and off.gain < repeated_nats(sweeps, past):
            return None
        if off.turned_by and not self._as_far(past, off.turned_by):
            return None
        self.strange = True
        return [off.suspicion] if off.is_sure else []

    def _as_far(self, past: Past, turned_by: int) -> bool:
        """The last sweeps' ranges, where the unit looks if it was turned, are as before."""
        sweeps = [seen.sweep for seen in self._last][-_TO_SHIFT:]
        return as_far(marks_of(sweeps, past, turned_by), sweeps[-1].air_measured)

    def _shift(self, past: Past) -> Shift | None:
        """The motion or jump of the last two sweeps, whichever is likelier, if it is likely."""
        sweeps = [seen.sweep for seen in self._last][-_TO_SHIFT:]
        if len(sweeps) < _TO_SHIFT:
            return None
        marks, measured = marks_of(sweeps, past), sweeps[-1].air_measured
        found = [each for each in (motion_of(marks, measured), jump_of(marks, measured)) if each is not None]
        best = max(found, key=_likely, default=None)
        if best is None or best.gain < _LEAST_SHIFT_GAIN:
            return None
        if not best.moved_m:  # each of them has to show it: the half of one that was moved looks like a jump
            alone = [marks_of([sweep], past) for sweep in sweeps]
            gains, motion = [gain_of(best, each, measured) for each in alone], motion_of(alone[-1], measured)
            if min(gains) < _LEAST_SHIFT_GAIN or (motion is not None and motion.gain > gains[-1]):
                return None
        return best

    def _shift_gain(self, past: Past, shift: Shift) -> float:
        """Of the last sweeps, as the gains of bearings that are off."""
        gain = 0.0
        for seen in self._last:
            shifted = shifted_nats(seen.sweep, past, shift.longer)
            gain += max(0.0, shifted - stay_fit(seen.sweep, past) * len(seen.sweep.range_m))
        return gain

    def _still_shifted(self, sweep: Readings, past: Past) -> Shift | None:
        """The one shown last, with what it gains in this sweep alone, if the sweep fits it about as well as usual and
        better than the past by enough: someone in a room at rest spoils the fit to both alike. A motion that was shown
        by the sweep in which ranges jumped is none, once the marks say so.
        """
        if self._known is None or (self._known.moved_m and _looks_like_a_jump(sweep, past)):
            return None
        readings = len(sweep.range_m)
        shifted = shifted_nats(sweep, past, self._known.longer)
        gain = shifted - stay_fit(sweep, past) * readings
        if gain < _LEAST_SHIFT_GAIN or shifted / readings < median(self.usual) - _BAD:
            return None
        return replace(self._known, gain=gain)

    def _as_usual(self) -> list[Suspicion]:
        self._well += 1
        if self._well == _FORGOTTEN_AFTER:
            self._known = None
        return []

    def _shifted(self, shift: Shift) -> list[Suspicion]:
        self.strange, self._known, self._well = True, shift, 0
        kind = messages.FAULT_KIND_MOVED if shift.moved_m else messages.FAULT_KIND_RANGES_JUMPED
        words = f"{shift.words}: {shift.fitting} marks fit that" if shift.moved_m else shift.words
        return [Suspicion(kind, shift.gain, words)]

    def _elsewhere(self, sweep: Readings, past: Past) -> list[Suspicion]:
        """Nothing fits the sweep, nor one of the two before, and it repeats that one; not where only one arc of the
        room has changed.
        """
        if self._last[-1].fit >= -_FOREIGN:
            return []
        self.stands = stands([seen.sweep for seen in self._last if seen.fit < -_FOREIGN], past)
        if self.stands:
            return []
        foreign = [seen.sweep for seen in list(self._last)[-3:-1] if seen.fit < -_FOREIGN]
        changes = [change_m(sweep, before, range(len(sweep.range_m)), _LEAST_REPEATED) for before in foreign]
        if not any(change is not None and change < NOISY_M for change in changes):
            return []
        words = "its sweeps repeat themselves and no longer fit its past: it was moved elsewhere, or the room changed"
        return [Suspicion(messages.FAULT_KIND_MOVED, 10.0, words)]

    def _noisy(self, sweep: Readings, past: Past) -> Suspicion | None:
        scatter, disagreement = scatter_m(sweep, past), disagreement_m([seen.sweep for seen in self._last], past)
        if scatter is None or disagreement is None or min(scatter, disagreement) < LEAST_M:
            return None
        if math.sqrt(scatter * disagreement) < NOISY_M:
            return None
        change = None if len(self._last) < 2 else change_m(sweep, self._last[-2].sweep, range(len(sweep.range_m)))
        if change is not None and change < NOISY_M:
            return None
        self.strange = True
        words = f"ranges scatter by {100 * scatter:.0f} cm and do not repeat themselves"
        return Suspicion(messages.FAULT_KIND_TOO_NOISY, 15.0, words)


def _looks_like_a_jump(sweep: Readings, past: Past) -> bool:
    """By its own marks, rather than like a motion."""
    marks = marks_of([sweep], past)
    jump, motion = jump_of(marks, sweep.air_measured), motion_of(marks, sweep.air_measured)
    return jump is not None and (motion is None or _likely(jump) > _likely(motion))


def _is_clear(shift: Shift) -> bool:
    """It is believed though the readings fit the past as usual: what is off by less than 2.5 cm still fits."""
    return not shift.moved_m or shift.gain >= _CLEAR_MOTION_GAIN


def _likely(shift: Shift) -> float:
    return shift.gain + _MARK_NATS * shift.fitting - (0.0 if shift.moved_m else _JUMP_LEADS)
