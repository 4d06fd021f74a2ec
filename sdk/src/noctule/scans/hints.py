"""What looks wrong in a scan though it can be read: wrong units, and time-outs that pass for ranges."""

from collections import Counter
from collections.abc import Sequence
from statistics import median

from noctule.scans.readings import ScanReading
from noctule.scans.units import Units

_SHORTEST_M, _LONGEST_M = 0.02, 8.0  # between which the median range of a scan of a room lies
_LEAST_REPEATS = 3
_GAP = 1.1  # a time-out lies beyond all that was measured, by a tenth at least
_LARGE_SHARE = 0.3  # of all readings: no wall answers so many with one value
_FULL_TURN = 6.3  # radians; a scan whose angles span less than that in degrees is hardly one


def hints(readings: Sequence[ScanReading], units: Units) -> list[str]:
    """Sentences that say what may be wrong and which option sets it right; none for a scan that looks well."""
    written = [reading.written for reading in readings if reading.flight_s is not None and reading.written is not None]
    found = [_time_out(written, len(readings)), _size(written, units), _angles(readings, units)]
    return [hint for hint in found if hint]


def _time_out(written: Sequence[float], readings: int) -> str:
    """About a value that repeats as no range does: nothing, the largest by far, or a third of all."""
    counts = Counter(written)
    values = sorted(counts)
    suspects = [value for value, count in counts.items() if count >= max(_LEAST_REPEATS, _LARGE_SHARE * readings)]
    if len(values) > 1 and counts[values[-1]] >= _LEAST_REPEATS and values[-1] > _GAP * values[-2]:
        suspects.append(values[-1])
    if 0.0 in counts:
        suspects.append(0.0)
    if not suspects:
        return ""
    named = sorted(set(suspects))
    shares = " and ".join(f"{value:g} ({counts[value] / readings:.0%} of the readings)" for value in named)
    verb, they = ("stand", "they mean") if len(named) > 1 else ("stands", "it means")
    values = ",".join(f"{value:g}" for value in named)
    return (
        f"{shares} {verb} out among the ranges: if {they} that nothing was heard, import again with --no-echo {values}"
    )


def _size(written: Sequence[float], units: Units) -> str:
    if not written:
        return "no reading heard anything: check --range and --no-echo"
    middle_m = median([value for value in written if value > 0] or [0.0]) * units.range_m  # 0 has a hint of its own
    if _SHORTEST_M <= middle_m <= _LONGEST_M:
        return ""
    return f"the median range is {middle_m:.3g} m: are the ranges really in {units.range_unit}? --units says otherwise"


def _angles(readings: Sequence[ScanReading], units: Units) -> str:
    angles = [reading.angle_deg for reading in readings]
    span_deg = max(angles) - min(angles)
    if units.angle_deg != 1.0 or span_deg > _FULL_TURN or len(set(angles)) < _LEAST_REPEATS:
        return ""
    return f"all angles lie within {span_deg:.3g} degrees: are they radians? --angle-units rad says so"
