"""What ``noctule-mapper reproduce`` runs: the mapper finds it as an entry point and imports nothing of this package."""

from collections.abc import Sequence
from pathlib import Path

from noctule.progress import progress
from noctule_reproduction.reproduce import REPORT, reproduce_into


def reproduce(out: Path, seeds: Sequence[int], jobs: int) -> None:
    """Write report, figures and recording into ``out`` from consecutive ``seeds`` and print a line for each method."""
    with progress() as shown:
        results = reproduce_into(out, seeds, jobs, shown)
    for method, one in results.comparisons.items():
        errors = one.corner_error, one.cylinder[3], one.cylinder[4]
        corner, centre, radius = (f"{error.mean:.2f} ± {error.deviation:.2f}" for error in errors)
        print(f"{method:8} corners {corner} cm, centre {centre} cm, radius {radius} cm; {one.missed} missed")
    print(f"simulated, {len(seeds)} seeds from {seeds[0]}: {out / REPORT}")
