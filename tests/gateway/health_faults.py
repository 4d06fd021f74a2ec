"""What goes wrong with a fixed unit, as its sweeps show it: one function a fault, each giving the ranges of a sweep."""

import math
from collections.abc import Callable

import numpy as np
from gateway.health_rooms import Noise, Stand, noisy, shifted, stand_of

from noctule import messages_pb2 as messages
from noctule.air import speed_of_sound_m_s

Sweeps = Callable[[int], np.ndarray]  # the n-th sweep with the fault: ranges (61,)
Make = Callable[[Stand, np.random.Generator], Sweeps]

PERIOD_DEG = 8 * 360 / 4075.77  # a half step that is lost costs a magnetic period (firmware/simulator/README.md)
HALF_STEPS_PER_BEARING = 51  # 4.5 degrees
COUNTER_TURN_S = 2**16 * 0.25e-6
LEAST_BESIDE_AN_ARC = 3  # bearings that answer


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
            way = rng.uniform(0, 2 * math.pi)
            wrong = stand.moved(distance_m * math.cos(way), distance_m * math.sin(way)).turned(degrees)
        return lambda _number: wrong.hears(rng)

    return make


def elsewhere(_stand: Stand, rng: np.random.Generator) -> Sweeps:
    other = None
    while other is None or not answers_at_all(other):
        other = stand_of(5000 + int(rng.integers(100)))
    return lambda _number: other.hears(rng)


def answers_at_all(stand: Stand) -> bool:
    return bool(np.isfinite(stand.clear_m).any())


def slips(probability: float) -> Make:
    """Each half step slips a period with that probability, against the sense of turning."""

    def make(stand: Stand, rng: np.random.Generator) -> Sweeps:
        off_deg = 0.0

        def sweep(number: int) -> np.ndarray:
            nonlocal off_deg
            sense, each_deg = (1 if number % 2 == 0 else -1), np.zeros(len(stand.bearings_rad))
            for bearing in range(len(each_deg))[::sense]:
                each_deg[bearing] = off_deg
                off_deg -= sense * PERIOD_DEG * rng.binomial(HALF_STEPS_PER_BEARING, probability)
            return shifted(stand, each_deg, rng)

        return sweep

    return make


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

    def make(stand: Stand, rng: np.random.Generator) -> Sweeps:
        def sweep(_number: int) -> np.ndarray:
            range_m = stand.hears(rng)
            slipped = np.where(range_m > turn_m, range_m - turn_m, range_m + turn_m)
            return np.where(rng.random(len(range_m)) < 0.25, slipped, range_m)

        return sweep

    return make


def arc_silent(degrees: float) -> Make:
    """The arc in which the most bearings answer, of those beside which enough do to tell it from a deaf sensor."""
    readings = round(degrees / 4.5) + 1

    def make(stand: Stand, rng: np.random.Generator) -> Sweeps:
        heard = np.array(np.isfinite(stand.clear_m).all(axis=0))
        within = np.convolve(heard, np.ones(readings), "valid")
        first = int(np.where(heard.sum() - within >= LEAST_BESIDE_AN_ARC, within, 0).argmax())

        def sweep(_number: int) -> np.ndarray:
            range_m = stand.hears(rng)
            range_m[first : first + readings] = math.nan
            return range_m

        return sweep

    return make


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


THREE, FIVE = 3, 5  # sweeps

# name: what happens, its name, and by which sweep it must be named
FAULTS: dict[str, tuple[Make, messages.FaultKind, int]] = {
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
    "moved 5 cm": (moved(0.05), messages.FAULT_KIND_MOVED, FIVE),
    "moved 20 cm": (moved(0.2), messages.FAULT_KIND_MOVED, FIVE),
    "moved 20 cm and turned 20 degrees": (moved(0.2, 20.0), messages.FAULT_KIND_MOVED, FIVE),
}
AIR_C = {"clock slips at 5 degrees C": 5.0, "clock slips at 30 degrees C": 30.0}  # the others: 20
WITH_A_DEAD_BEARING: dict[str, tuple[Make, messages.FaultKind, int]] = {
    "turned 5 degrees": (turned(5.0), messages.FAULT_KIND_TURNED, FIVE),
    "moved 5 cm": (moved(0.05), messages.FAULT_KIND_MOVED, FIVE),
    # Its neighbours stay within 5 cm of their past, so that each of these sweeps shows the dead bearing too.
    "ranges 4 cm longer": (ranges(longer_m=0.04), messages.FAULT_KIND_RANGES_JUMPED, THREE),
}
FROM_A_SWEEPS_BEGINNING = frozenset(name for name in FAULTS if name.startswith(("slips", "play")))
