"""Whether a fixed unit still stands and points as it did: turned, slipped, with play, moved, or only too noisy to tell.

A sweep is looked at closely only where it fits the past worse than usual, by 0.2 nats a reading; of sound sweeps with
nobody in the room that is one in some hundred. What explains it must then fit about as well as usual, which no change
of the room does. One sweep proves nothing: those of a motion must agree, and ``Fault.named_after`` says how many.
"""

from collections import deque
from collections.abc import Sequence
from math import degrees, hypot
from statistics import median

from noctule import messages_pb2 as messages
from noctule_gateway.health.alignment import Alignment, align, stay_fit
from noctule_gateway.health.jump import is_air, jump_of
from noctule_gateway.health.look import Look
from noctule_gateway.health.marks import Motion, marks_of, motion_of
from noctule_gateway.health.noise import NOISY_M, change_m, disagreement_m, scatter_m
from noctule_gateway.health.past import Past
from noctule_gateway.health.suspicion import Suspicion

_WORSE = 0.2  # nats a reading, than usual: looked at closely
_GOOD = 0.9  # no more than so much worse than usual: this explains the sweep
_BAD = 0.8  # worse than usual: something is wrong
_FOREIGN = 1.2  # worse than usual: this may be another room
_LEAST_GAIN = 6.0  # of one offset over none
_LEAST_PATH_GAIN = 12.0  # of an offset that changes over one that does not
_LEAST_PATH_GAIN_IN_ALL = 25.0  # over none
_LEAST_OFF = 0.5  # of the bearings, where a motor slips: what stands in an open door changes fewer
_LEAST_VARIATION = 2  # bearing steps within a sweep: less is two offsets that are equally likely
_LEAST_MOVED_M = 0.025
_SAME_MOTION_M = 0.03
_LEAST_MARKS = 3
_FITTING_SHARE = 0.7
_NEWLY_EXPLAINED = 2  # marks
_KEPT_USUAL, _LEAST_USUAL = 20, 3
_LEAST_STABLE = 8  # bearings: fewer tell nothing of the place
_LEAST_ENTRIES = 4  # of a past, from which on a fit to it is a usual one


class PlaceWatch:
    """Remembers the sweep before, and how well sweeps usually fit. ``strange``: the last one fits nothing known."""

    def __init__(self, usual: Sequence[float] = ()) -> None:
        self.usual: deque[float] = deque(usual, _KEPT_USUAL)
        self.strange = False
        self._before: Look | None = None
        self._foreign = 0  # sweeps in a row that fit the past not at all
        self._motion: Motion | None = None
        self._offsets: deque[int | None] = deque(maxlen=3)  # of the last sweeps; None where no offset fits

    def suspicions(self, look: Look, past: Past) -> list[Suspicion]:
        """What the sweep shows; the past is asked, not changed."""
        self.strange = False
        found, offset = self._looked_at(look, past)
        self._offsets.append(offset)
        if play := self._play(look):
            found = [play]
        self._before = look
        return found

    def learn_from(self, look: Look, past: Past) -> None:
        """The sweep is well, and not in the past yet: this is how well one usually fits."""
        if len(past) >= _LEAST_ENTRIES:
            self.usual.append(stay_fit(look, past))

    def _looked_at(self, look: Look, past: Past) -> tuple[list[Suspicion], int | None]:
        motion, self._motion = self._motion, None
        foreign, self._foreign = self._foreign, 0
        if len(self.usual) < _LEAST_USUAL or len(past.stable()) < _LEAST_STABLE:
            return [], None
        usual, fit = median(self.usual), stay_fit(look, past)
        if fit >= usual - _WORSE:
            return [], 0
        alignment = align(look, past)
        self.strange = fit < usual - _BAD
        self._foreign = foreign + 1 if fit < usual - _FOREIGN else 0
        if alignment is not None:
            if slipped := _slipped(alignment, usual):
                return [slipped], None
            if turned := _turned(alignment, usual):
                return [turned], alignment.offset
        if noisy := self._noisy(look, past):
            return [noisy], None
        marks = marks_of(look, past)
        now = motion_of(marks)
        if (jump := jump_of(marks)) is not None and (now is None or jump.fitting >= now.fitting):
            self.strange = not is_air(jump, look.air_measured)
            if not self.strange:
                return [], 0
            return [Suspicion(messages.FAULT_KIND_RANGES_JUMPED, 7.0 * jump.fitting, jump.words)], None
        fits_best_as_it_was = alignment is not None and not alignment.offset and not self.strange
        return self._moved(look, past, motion), 0 if fits_best_as_it_was else None

    def _moved(self, look: Look, past: Past, before: Motion | None) -> list[Suspicion]:
        motion = motion_of(marks_of(look, past))
        if motion is None or not _explains(motion):
            return self._elsewhere(look)
        self.strange, self._motion = True, motion
        if before is None or hypot(motion.x_m - before.x_m, motion.y_m - before.y_m) > _SAME_MOTION_M:
            return []
        nats = 7.0 * (motion.fitting - motion.still)
        words = f"it was moved by {100 * motion.distance_m:.0f} cm: {motion.fitting} of {motion.marks} marks fit that"
        return [Suspicion(messages.FAULT_KIND_MOVED, nats, words)]

    def _elsewhere(self, look: Look) -> list[Suspicion]:
        """Nothing fits, and the sweep repeats the one before."""
        if self._foreign < 2 or self._before is None:
            return []
        change = change_m(look, self._before, range(len(look.range_m)))
        if change is None or change >= NOISY_M:
            return []
        words = "its sweeps repeat themselves and no longer fit its past: it was moved elsewhere, or the room changed"
        return [Suspicion(messages.FAULT_KIND_MOVED, 10.0, words)]

    def _noisy(self, look: Look, past: Past) -> Suspicion | None:
        scatter, disagreement = scatter_m(look, past), disagreement_m(look, past)
        if scatter is None or disagreement is None or min(scatter, disagreement) < NOISY_M:
            return None
        change = None if self._before is None else change_m(look, self._before, past.stable())
        if change is not None and change < NOISY_M:
            return None
        self.strange = True
        words = f"ranges scatter by {100 * scatter:.0f} cm and do not repeat themselves"
        return Suspicion(messages.FAULT_KIND_TOO_NOISY, 15.0, words)

    def _play(self, look: Look) -> Suspicion | None:
        """The last three sweeps, of alternating senses, have offsets a, b, a."""
        if self._before is None or self._before.forward == look.forward or len(self._offsets) < 3:
            return None
        a, b, c = self._offsets
        if a is None or b is None or c is None or abs(a - c) > 1 or min(abs(a - b), abs(c - b)) < 2:
            return None
        self.strange = True
        step_deg = degrees(look.bearing_rad[1] - look.bearing_rad[0])
        words = f"bearings differ by {abs(c - b) * step_deg:.0f} degrees between the two senses of turning"
        return Suspicion(messages.FAULT_KIND_PLAY, 20.0, words)


def _slipped(alignment: Alignment, usual: float) -> Suspicion | None:
    low, high = min(alignment.path), max(alignment.path)
    off = sum(each != 0 for each in alignment.path)
    if high - low < _LEAST_VARIATION or alignment.path_fit < usual - _GOOD or off < _LEAST_OFF * len(alignment.path):
        return None
    if alignment.path_gain < _LEAST_PATH_GAIN or alignment.path_gain + alignment.gain < _LEAST_PATH_GAIN_IN_ALL:
        return None
    off_deg = degrees(max(abs(low), abs(high)) * alignment.step_rad)
    words = f"bearings are off by up to {off_deg:.0f} degrees, by different angles within one sweep"
    return Suspicion(messages.FAULT_KIND_SLIPPED, alignment.path_gain, words)


def _turned(alignment: Alignment, usual: float) -> Suspicion | None:
    if not alignment.offset or alignment.gain < _LEAST_GAIN or alignment.fit < usual - _GOOD:
        return None
    turned_deg = degrees(alignment.turned_rad)
    way = "anticlockwise" if turned_deg > 0 else "clockwise"
    return Suspicion(
        messages.FAULT_KIND_TURNED, alignment.gain, f"it was turned {way} by about {abs(turned_deg):.0f} degrees"
    )


def _explains(motion: Motion) -> bool:
    return (
        motion.distance_m >= _LEAST_MOVED_M
        and motion.fitting >= max(_LEAST_MARKS, _FITTING_SHARE * motion.marks)
        and motion.fitting - motion.still >= _NEWLY_EXPLAINED
    )
