"""How near the mapper comes to a fit that is told every label, over many simulated rooms.

    PYTHONPATH=tests python tests/bench/accuracy.py paper|random|hard [--rooms 50] [--seed 1] [--method refined] ...

A room is made from its own seed, ``--seed`` and on, so that a line about a faulty room says how to see it alone.
Nothing is passed or failed here.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields
from functools import partial
from operator import attrgetter

import numpy as np
from mapper.judge import Errors
from mapper.judged_room import KINDS, Run, run
from scipy.stats import chi2


def warm_up(method: str) -> None:
    """Import and compile what the first room would otherwise pay for."""
    run(0, "paper", method, True)


def main() -> None:
    asked = argparse.ArgumentParser(description="The mapper's accuracy over many simulated rooms.")
    asked.add_argument("kind", choices=KINDS)
    asked.add_argument("--rooms", type=int, default=50)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--method", default="refined")
    asked.add_argument("--jobs", type=int, default=2)
    asked.add_argument("--uncalibrated", action="store_true", help="sweeps do not tell the ranges' spread")
    asked.add_argument("--verbose", action="store_true", help="a line for every room, not for faulty ones alone")
    args = asked.parse_args()
    one = partial(run, kind=args.kind, method=args.method, calibrated=not args.uncalibrated)
    with ProcessPoolExecutor(args.jobs, initializer=warm_up, initargs=(args.method,)) as pool:
        runs = list(pool.map(one, range(args.seed, args.seed + args.rooms)))
    for each in runs:
        if args.verbose or each.verdict.missed or each.verdict.false:
            print(_line(each))
    print("\n".join(_summary(runs)), flush=True)


def _line(one: Run) -> str:
    errors = one.verdict.corners
    faults = [f"MISSED {what}" for what in one.verdict.missed] + [f"FALSE {what}" for what in one.verdict.false]
    figures = f"corners {_cm(errors.mapper_m)} / {_cm(errors.label_fit_m)} cm, {one.fit_ms:.0f} ms"
    return f"room {one.seed}: {figures}; {'; '.join(faults) or 'whole'}"


def _summary(runs: Sequence[Run]) -> list[str]:
    verdicts = [one.verdict for one in runs]
    lines = []
    for what in ("corners", "centres", "radii"):
        errors: list[Errors] = [attrgetter(what)(verdict) for verdict in verdicts]
        if sum(len(one.mapper_m) for one in errors):
            lines.append(f"{what:9} {_against_the_label_fit(errors)}")
    for kind, freedom in (("wall", 2), ("corner", 2), ("cylinder", 3)):
        squares = np.concatenate([attrgetter(f"{kind}_squares")(verdict) for verdict in verdicts])
        if len(squares):
            lines.append(f"{kind + 's':9} {len(squares):5d}  {_honesty(squares, freedom)}")
    missed, false = (sum(len(getattr(verdict, fault)) for verdict in verdicts) for fault in ("missed", "false"))
    fit_ms = [one.fit_ms for one in runs]
    lines.append(f"{missed} missed, {false} false in {len(runs)} rooms")
    lines.append(f"fit: median {np.median(fit_ms):.0f} ms, most {max(fit_ms):.0f} ms of processor time")
    return lines


def _against_the_label_fit(errors: Sequence[Errors]) -> str:
    """Mean errors and their ratios; the ratio by weight is of root mean squares, each error over its sigma, so that
    one thing that the echoes hardly determine does not outweigh all the others.
    """
    ours, told, told_late, sigma = (
        np.concatenate([getattr(one, field.name) for one in errors]) for field in fields(Errors)
    )
    by_weight = np.sqrt(((ours / sigma) ** 2).mean() / ((told / sigma) ** 2).mean())
    return (
        f"{len(ours):5d}  {_cm(ours)} cm; told every label {_cm(told)}, ratio {ours.mean() / told.mean():.3f} "
        f"(by weight {by_weight:.3f}); and which are late {_cm(told_late)}, ratio {ours.mean() / told_late.mean():.3f}"
    )


def _honesty(squares: np.ndarray, freedom: int) -> str:
    """The mean square per coordinate, and how likely honest covariances are to be as far off, to either side."""
    total, count = float(squares.sum()), freedom * len(squares)
    p = 2 * min(chi2.cdf(total, count), chi2.sf(total, count))
    bulk = np.median(squares) / chi2.median(freedom)  # the same from the median, which no outlier rules
    return f"squared normalised error {total / count:.3f} per coordinate (bulk {bulk:.3f}), p = {p:.2g}"


def _cm(errors_m: np.ndarray) -> str:
    return f"{100 * errors_m.mean():.3f}" if len(errors_m) else "-"


if __name__ == "__main__":
    main()
