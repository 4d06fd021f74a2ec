"""Where one pass of a scanner over its angles ends and the next begins, and how a pass becomes sweeps."""

from collections.abc import Sequence
from itertools import pairwise
from statistics import median, mode

from noctule.bounds import MAX_READINGS, number
from noctule.scans.readings import ScanReading

_LONGEST_OFFSET_S = number("Reading", "time_offset_s").most
_MOST_OF_ALL = 0.6  # of the angles' span; no multiple of a step in any plan of few bearings
_TURN_STEPS = 2.5  # back from the farthest angle by more than this is a turn; less is a servo that trembles


def passes(readings: Sequence[ScanReading]) -> list[list[ScanReading]]:
    """The readings pass by pass. A pass ends where the scanner turns or goes back to its start, where it stands at
    another place, where its clock starts again, and where the file counts sweeps itself, there alone.
    """
    parts: list[list[ScanReading]] = []
    for reading in readings:
        if not parts or _is_elsewhere(parts[-1], reading):
            parts.append([])
        parts[-1].append(reading)
    if readings and readings[0].sweep is not None:
        return parts
    return [each for part in parts for each in _between_turns(part)]


def sweeps_of(one_pass: Sequence[ScanReading]) -> list[list[ScanReading]]:
    """A pass as sweeps of 64 readings at most.

    A reading that was repeated at each angle gives as many sweeps. What is still too long is dealt out in turn, so
    that each sweep covers all that the scanner looked at.
    """
    runs = _runs(one_pass)
    layers = [
        [run[layer] for run in runs if layer < len(run)] for layer in range(_repeats(runs))
    ]  # what is beyond the usual repeats stays in the last one
    layers[-1] += [reading for run in runs for reading in run[len(layers) :]]
    dealt = ((layer, -(-len(layer) // MAX_READINGS)) for layer in layers)
    return [list(layer[start::count]) for layer, count in dealt for start in range(count)]


def _is_elsewhere(part: Sequence[ScanReading], reading: ScanReading) -> bool:
    first, last = part[0], part[-1]
    if reading.place != last.place or reading.sweep != last.sweep:
        return True
    if reading.time_s is None or last.time_s is None or first.time_s is None:
        return False
    return reading.time_s < last.time_s or reading.time_s - first.time_s > _LONGEST_OFFSET_S


def _between_turns(part: Sequence[ScanReading]) -> list[list[ScanReading]]:
    """A zigzag with hysteresis: a turn is at the farthest angle, once the scanner has come back from it far enough."""
    runs = _runs(part)
    angles = [run[0].angle_deg for run in runs]
    if len(runs) < 3:
        return [list(part)]
    steps = [abs(after - before) for before, after in pairwise(angles)]
    back_deg = min(_TURN_STEPS * median(steps), _MOST_OF_ALL * (max(angles) - min(angles)))
    repeats = _repeats(runs)
    found: list[list[ScanReading]] = []
    begun: list[ScanReading] = []  # of the run at the last turn, what belongs to the pass after it
    for first, last in _zigzag(angles, back_deg):
        turning = runs[last]
        is_turn = last + 1 < len(runs)
        kept = turning[:repeats] if is_turn and last > first else turning
        found.append([*begun, *(reading for run in runs[first:last] for reading in run), *kept])
        begun = turning[len(kept) :]
    return found


def _zigzag(angles: Sequence[float], back: float) -> list[tuple[int, int]]:
    """First and last index of each monotonic stretch, but for returns of ``back`` at most. After a step across
    most of the angles, to where it began, a scanner may go either way.
    """
    most_step = _MOST_OF_ALL * (max(angles) - min(angles))
    stretches: list[tuple[int, int]] = []
    first, farthest, sign, index = 0, 0, 0, 0
    while index < len(angles):
        if sign == 0 and abs(angles[index] - angles[first]) > back:
            sign = 1 if angles[index] > angles[first] else -1
        if sign == 0 or sign * (angles[index] - angles[farthest]) >= 0:
            farthest = index
        elif sign * (angles[farthest] - angles[index]) > back:
            stretches.append((first, farthest))
            flew_back = abs(angles[farthest + 1] - angles[farthest]) > most_step
            first = index = farthest = farthest + 1
            sign = 0 if flew_back else -sign
            continue
        index += 1
    stretches.append((first, len(angles) - 1))
    return stretches


def _runs(readings: Sequence[ScanReading]) -> list[list[ScanReading]]:
    """Readings one after the other at one angle, together."""
    runs: list[list[ScanReading]] = []
    for reading in readings:
        if not runs or reading.angle_deg != runs[-1][0].angle_deg:
            runs.append([])
        runs[-1].append(reading)
    return runs


def _repeats(runs: Sequence[Sequence[ScanReading]]) -> int:
    """How many readings the scanner usually takes at an angle."""
    return mode(len(run) for run in runs)
