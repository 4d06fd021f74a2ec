"""What goes wrong with a fixed unit, as its sweeps show it: one function a fault, each giving the ranges of a sweep.

A fault that begins without changing what the unit hears can't be told by any detector. So where the physics of a room
leaves nothing to hear of a fault, None is given in place of its sweeps: an arc that looks at too few reflectors, a
motion that changes ranges no more than warmer air does, slips that sound like a turn. The rules know the room, the
fault and, of slips, the readings; they ask no detector.
"""

import math
from collections.abc import Callable

import numpy as np
from gateway.health_rooms import Noise, Stand, always_heard, noisy, reflectors_of, shifted, stand_of

from noctule import messages_pb2 as messages
from noctule.air import speed_of_sound_m_s

Sweeps = Callable[[int], np.ndarray]  # the n-th sweep with the fault: ranges (61,)
Make = Callable[[Stand, np.random.Generator], Sweeps]
MakeIfShown = Callable[[Stand, np.random.Generator], Sweeps | None]  # None: it does not show in this room

PERIOD_DEG = 8 * 360 / 4075.77  # a half step that is lost costs a magnetic period (firmware/simulator/README.md)
HALF_STEPS_PER_BEARING = 51  # 4.5 degrees
COUNTER_TURN_S = 2**16 * 0.25e-6
THREE, FIVE = 3, 5  # sweeps
# gateway/README.md, "Health": an arc of 90 degrees, or 60 with three reflectors. One bearing more at each end, since
# one that answers may have been lost too often to count as usual; and five beside it that answer: of these, 8 % lost
# and 4 % false, all fail in one sweep of 40,000.
LEAST_ARC_DEG, LEAST_ARC_OF_MARKS_DEG, LEAST_IN_AN_ARC, LEAST_BESIDE_AN_ARC = 99.0, 69.0, 10, 5
# Ranges change by up to 1.2 % with air that is warmer than was measured. What a motion does to two reflectors beyond
# that must be 3.5 times the scatter of a mark, 4 mm.
MOST_WARMER, LEAST_BEYOND_M, LEAST_BEYOND = 0.012, 0.014, 2
# A jump changes all ranges by one share, of up to 12 %, or by one length: one reflector that is off beyond tells.
MOST_JUMP, MOST_JUMP_M = 0.12, 0.25
LEAST_ANGLE_DEG = 25.0  # between two reflectors, or what a motion does across them does not show
NEAR_M, MOST_NEAR = 0.25, 8  # readings: nearer to more the unit is blocked, too
WAYS = 20  # of a motion that are tried
LEAST_SLIPS = 4  # bearings, in the two whole sweeps: of fewer some are false echoes
LEAST_TELLING = 5  # readings: of these, too, all fail in one case of 40,000
MOST_TURNED_DEG = 99.0


def repeats(*values_m: float) -> Make:
    return lambda stand, _rng: lambda _number: np.resize(np.array(values_m), len(stand.bearings_rad))


def silent(stand: Stand, _rng: np.random.Generator) -> Sweeps:
    return lambda _number: np.full(len(stand.bearings_rad), math.nan)


def covered(stand: Stand, rng: np.random.Generator) -> Sweeps:
    return lambda _number: noisy(np.full(len(stand.bearings_rad), 0.08), rng, Noise())


def box_before_it(stand: Stand, rng: np.random.Generator) -> Sweeps:
    first = int(rng.integers(0, 40))

    def sweep(_number: int) -> np.ndarray:
        range_m = stand.hears(rng)
        range_m[first : first + 20] = noisy(np.full(20, 0.12), rng, Noise())
        return range_m

    return sweep


def motor_stuck(stand: Stand, rng: np.random.Generator) -> Sweeps:
    """At a bearing that answers: at one that does not, it is as good as deaf."""
    answers = np.nonzero(np.ptp(stand.clear_m, axis=0) < 0.01)[0]
    range_m = stand.clear_m[0, rng.choice(answers)]
    return lambda _number: noisy(np.full(len(stand.bearings_rad), range_m), rng, Noise())


def turned(degrees: float) -> Make:
    def make(stand: Stand, rng: np.random.Generator) -> Sweeps:
        wrong = stand.turned(degrees)
        return lambda _number: wrong.hears(rng)

    return make


def moved(distance_m: float, degrees: float = 0.0) -> Make:
    """To where it hears something: elsewhere it is as good as deaf."""

    def make(stand: Stand, rng: np.random.Generator) -> Sweeps:
        wrong = None
        while wrong is None or not answers_at_all(wrong):
            wrong = moved_somewhere(stand, rng, distance_m).turned(degrees)
        return lambda _number: wrong.hears(rng)

    return make


def moved_that_shows(distance_m: float, degrees: float = 0.0) -> MakeIfShown:
    """To where it hears reflectors of before, farther or nearer, and is not blocked."""

    def make(stand: Stand, rng: np.random.Generator) -> Sweeps | None:
        for _ in range(WAYS):
            wrong = moved_somewhere(stand, rng, distance_m)
            if motion_shows(stand, wrong) and (wrong.clear_m < NEAR_M).any(axis=0).sum() <= MOST_NEAR:
                there = wrong.turned(degrees)
                return lambda _number: there.hears(rng)
        return None

    return make


def moved_somewhere(stand: Stand, rng: np.random.Generator, distance_m: float) -> Stand:
    way = rng.uniform(0, 2 * math.pi)
    return stand.moved(distance_m * math.cos(way), distance_m * math.sin(way))


def motion_shows(before: Stand, after: Stand) -> bool:
    """Three reflectors that are heard before and after tell the motion from air that is warmer or colder, and from
    ranges that have jumped.
    """
    heard = always_heard(after)
    kept = [(run, [n for n in run if heard[n]]) for run in reflectors_of(before)]
    kept = [(run, still) for run, still in kept if 2 * len(still) >= len(run) and len(still) >= 2]
    if len(kept) < 3:
        return False
    way = np.array([2 * before.bearings_rad[run].mean() for run, _ in kept])  # doubled: opposite ones tell the same
    if np.abs(np.angle(np.exp(1j * (way[:, None] - way)))).max() < 2 * math.radians(LEAST_ANGLE_DEG):
        return False
    range_m = np.array([before.clear_m[0, run].mean() for run, _ in kept])
    longer_m = np.array([(after.clear_m[0, still] - before.clear_m[0, still]).mean() for _, still in kept])
    shares, lengths_m = np.linspace(-1, 1, 97)[:, None] * range_m, np.linspace(-1, 1, 97)[:, None] + 0 * range_m

    def beyond(explained_m: np.ndarray) -> int:
        """How many reflectors the best of these explanations leaves over."""
        return int((np.abs(longer_m - explained_m) >= LEAST_BEYOND_M).sum(axis=1).min())

    of_jumps = min(beyond(MOST_JUMP * shares), beyond(MOST_JUMP_M * lengths_m))
    return beyond(MOST_WARMER * shares) >= LEAST_BEYOND and of_jumps >= 1


def elsewhere(_stand: Stand, rng: np.random.Generator) -> Sweeps:
    other = None
    while other is None or not answers_at_all(other):
        other = stand_of(5000 + int(rng.integers(100)))
    return lambda _number: other.hears(rng)


def answers_at_all(stand: Stand) -> bool:
    return bool(np.isfinite(stand.clear_m).any())


def slips(probability: float) -> MakeIfShown:
    """Each half step slips a period with that probability, against the sense of turning."""

    def make(stand: Stand, rng: np.random.Generator) -> Sweeps | None:
        off_deg, each_deg = 0.0, np.zeros((THREE, len(stand.bearings_rad)))

        def sweep(number: int) -> np.ndarray:
            nonlocal off_deg
            sense, each = (1 if number % 2 == 0 else -1), each_deg[number % THREE]
            for bearing in range(len(each))[::sense]:
                each[bearing] = off_deg
                off_deg -= sense * PERIOD_DEG * rng.binomial(HALF_STEPS_PER_BEARING, probability)
            return shifted(stand, each, rng)

        first = np.array([sweep(number) for number in range(THREE)])
        shown = slips_show(stand, each_deg, first)
        return (lambda number: first[number] if number < THREE else sweep(number)) if shown else None

    return make


def slips_show(stand: Stand, off_deg: np.ndarray, range_m: np.ndarray) -> bool:
    """The readings (sweeps, n), each off by its angle, tell a motor that slips from a unit that was turned within them.

    All that the unit can know of its room is what it used to hear at its bearings. A reading tells if it is as one of
    the two bearings beside its direction was, and as neither of those is where the turned unit would look.
    """
    known_m = np.where(always_heard(stand), stand.clear_m[0], math.nan)
    step_deg = math.degrees(stand.bearings_rad[1] - stand.bearings_rad[0])

    def fits(by_deg: np.ndarray) -> np.ndarray:
        at = np.arange(len(known_m)) + by_deg / step_deg
        beside = [np.floor(at).astype(int), np.ceil(at).astype(int)]
        beyond = (beside[0] < 0) | (beside[1] >= len(known_m))
        return np.logical_or.reduce([beyond, *(same(range_m, known_m[each % len(known_m)]) for each in beside)])

    def unlike(by_deg: float) -> np.ndarray:
        """In the order of time."""
        tells = fits(off_deg) & ~fits(np.full_like(off_deg, by_deg))
        return np.concatenate([each[:: 1 if number % 2 == 0 else -1] for number, each in enumerate(tells)])

    before = np.cumsum(unlike(0.0))
    turned = [unlike(by_deg) for by_deg in np.arange(-MOST_TURNED_DEG, MOST_TURNED_DEG, step_deg / 2)]
    return min(int((before - each.cumsum() + each.sum()).min()) for each in turned) >= LEAST_TELLING


def same(one_m: np.ndarray, other_m: np.ndarray) -> np.ndarray:
    """Where both hear one reflector, or nothing."""
    return (np.isnan(one_m) & np.isnan(other_m)) | (np.abs(one_m - other_m) <= 0.025)


def play(forward_deg: float, backward_deg: float) -> Make:
    def make(stand: Stand, rng: np.random.Generator) -> Sweeps:
        senses = stand.turned(forward_deg), stand.turned(backward_deg)
        return lambda number: senses[number % 2].hears(rng)

    return make


def ranges(scale: float = 1.0, longer_m: float = 0.0) -> Make:
    return lambda stand, rng: lambda _number: scale * stand.hears(rng) + longer_m


def noise(sigma_m: float = 0.0032, false: float = 0.04) -> Make:
    return lambda stand, rng: lambda _number: stand.hears(rng, Noise(sigma_m=sigma_m, false=false))


def clock_slips(air_c: float) -> Make:
    turn_m = COUNTER_TURN_S * speed_of_sound_m_s(air_c) / 2

    def sweep(stand: Stand, rng: np.random.Generator) -> tuple[np.ndarray, set[int]]:
        """Ranges, and at which bearings that always answer an echo has slipped."""
        range_m, slips = stand.hears(rng), rng.random(len(stand.bearings_rad)) < 0.25
        true = np.abs(range_m - stand.clear_m[0]) < 0.02  # no false echo
        slipped = np.where(range_m > turn_m, range_m - turn_m, range_m + turn_m)
        return np.where(slips, slipped, range_m), set(np.nonzero(slips & true & always_heard(stand))[0].tolist())

    def make(stand: Stand, rng: np.random.Generator) -> Sweeps:
        drawn = [sweep(stand, rng) for _ in range(THREE)]
        while len(drawn[-1][1] | drawn[-2][1]) < LEAST_SLIPS:
            drawn = [sweep(stand, rng) for _ in range(THREE)]
        return lambda number: drawn[number][0] if number < THREE else sweep(stand, rng)[0]

    return make


def arc_silent(degrees: float) -> MakeIfShown:
    """The arc in which the most bearings answer, of those that show."""
    readings = round(degrees / 4.5) + 1

    def make(stand: Stand, rng: np.random.Generator) -> Sweeps | None:
        heard = always_heard(stand)
        shown = [first for first in range(len(heard) - readings + 1) if arc_shows(stand, first, first + readings)]
        if not shown:
            return None
        first = max(shown, key=lambda first: heard[first : first + readings].sum())

        def sweep(_number: int) -> np.ndarray:
            range_m = stand.hears(rng)
            range_m[first : first + readings] = math.nan
            return range_m

        return sweep

    return make


def arc_shows(stand: Stand, first: int, end: int) -> bool:
    """The arc held so much, and so much beside it answers, that its silence is neither a door's nor a deaf sensor's."""
    heard = np.nonzero(always_heard(stand))[0]
    within = heard[(heard >= first) & (heard < end)]
    if len(within) < LEAST_IN_AN_ARC or len(heard) - len(within) < LEAST_BESIDE_AN_ARC:
        return False
    reflectors = sum(first <= run[0] and run[-1] < end for run in reflectors_of(stand))
    wide_deg = math.degrees(stand.bearings_rad[within[-1]] - stand.bearings_rad[within[0]])
    return wide_deg >= (LEAST_ARC_OF_MARKS_DEG if reflectors >= 3 else LEAST_ARC_DEG)


def beside_a_dead_bearing(make: Make) -> Make:
    """The fault of a unit that has had a dead bearing for long."""

    def both(stand: Stand, rng: np.random.Generator) -> Sweeps:
        faulty, dead = make(stand, rng), between_alike(stand)

        def sweep(number: int) -> np.ndarray:
            range_m = faulty(number)
            range_m[dead] = math.nan
            return range_m

        return sweep

    return both


def between_alike(stand: Stand) -> int:
    """A bearing that always answers, as both its neighbours do, from one reflector."""
    heard = np.array(np.isfinite(stand.clear_m).all(axis=0))
    return next(
        n
        for n in range(1, len(heard) - 1)
        if heard[n - 1 : n + 2].all() and np.ptp(stand.clear_m[:, n - 1 : n + 2]) < 0.02
    )


# name: what happens, its name, and by which sweep it must be named
FAULTS: dict[str, tuple[MakeIfShown, messages.FaultKind, int]] = {
    "deaf": (silent, messages.FAULT_KIND_SILENT, THREE),
    "repeats one value": (repeats(1.234), messages.FAULT_KIND_REPEATS, THREE),
    "repeats zero": (repeats(0.0), messages.FAULT_KIND_REPEATS, THREE),
    "repeats its longest value": (repeats(6.5), messages.FAULT_KIND_REPEATS, THREE),
    "repeats two values": (repeats(0.45, 1.2), messages.FAULT_KIND_REPEATS, THREE),
    "covered by a cloth": (covered, messages.FAULT_KIND_BLOCKED, THREE),
    "a box before it": (box_before_it, messages.FAULT_KIND_BLOCKED, THREE),
    "motor stuck": (motor_stuck, messages.FAULT_KIND_MOTOR_STUCK, THREE),
    "slips 1 in 100": (slips(0.01), messages.FAULT_KIND_SLIPPED, THREE),
    "slips 1 in 50": (slips(0.02), messages.FAULT_KIND_SLIPPED, THREE),
    "play of 9 degrees": (play(4.5, -4.5), messages.FAULT_KIND_PLAY, THREE),
    "play of 9 degrees in one sense": (play(9.0, 0.0), messages.FAULT_KIND_PLAY, THREE),
    "ranges 3 % longer": (ranges(1.03), messages.FAULT_KIND_RANGES_JUMPED, THREE),
    "ranges 3 % shorter": (ranges(0.97), messages.FAULT_KIND_RANGES_JUMPED, THREE),
    "ranges 6 cm longer": (ranges(longer_m=0.06), messages.FAULT_KIND_RANGES_JUMPED, THREE),
    "noise of 6 cm": (noise(sigma_m=0.06), messages.FAULT_KIND_TOO_NOISY, THREE),
    "noise of 10 cm": (noise(sigma_m=0.1), messages.FAULT_KIND_TOO_NOISY, THREE),
    "noise of 20 cm": (noise(sigma_m=0.2), messages.FAULT_KIND_TOO_NOISY, THREE),
    "clock slips": (clock_slips(20.0), messages.FAULT_KIND_CLOCK_SLIPS, THREE),
    "clock slips at 5 degrees C": (clock_slips(5.0), messages.FAULT_KIND_CLOCK_SLIPS, THREE),
    "clock slips at 30 degrees C": (clock_slips(30.0), messages.FAULT_KIND_CLOCK_SLIPS, THREE),
    "an arc of 130 degrees falls silent": (arc_silent(130.5), messages.FAULT_KIND_ARC_SILENT, THREE),
    "an arc of 180 degrees falls silent": (arc_silent(180.0), messages.FAULT_KIND_ARC_SILENT, THREE),
    "turned 5 degrees": (turned(5.0), messages.FAULT_KIND_TURNED, FIVE),
    "turned 5 degrees back": (turned(-5.0), messages.FAULT_KIND_TURNED, FIVE),
    "turned 25 degrees": (turned(25.0), messages.FAULT_KIND_TURNED, FIVE),
    "turned 60 degrees back": (turned(-60.0), messages.FAULT_KIND_TURNED, FIVE),
    "carried into another room": (elsewhere, messages.FAULT_KIND_MOVED, FIVE),
    "moved 5 cm": (moved_that_shows(0.05), messages.FAULT_KIND_MOVED, FIVE),
    "moved 20 cm": (moved_that_shows(0.2), messages.FAULT_KIND_MOVED, FIVE),
    "moved 20 cm and turned 20 degrees": (moved_that_shows(0.2, 20.0), messages.FAULT_KIND_MOVED, FIVE),
}
AIR_C = {"clock slips at 5 degrees C": 5.0, "clock slips at 30 degrees C": 30.0}  # the others: 20
WITH_A_DEAD_BEARING: dict[str, tuple[Make, messages.FaultKind, int]] = {
    "turned 5 degrees": (turned(5.0), messages.FAULT_KIND_TURNED, FIVE),
    "moved 5 cm": (moved(0.05), messages.FAULT_KIND_MOVED, FIVE),
    # Its neighbours stay within 5 cm of their past, so that each of these sweeps shows the dead bearing too.
    "ranges 4 cm longer": (ranges(longer_m=0.04), messages.FAULT_KIND_RANGES_JUMPED, THREE),
}
FROM_A_SWEEPS_BEGINNING = frozenset(name for name in FAULTS if name.startswith(("slips", "play")))
