"""How near the mapper comes to a fit that is told every label, over many simulated rooms.

    PYTHONPATH=tests python tests/bench/accuracy.py paper|random|hard [--rooms 50] [--seed 1] [--method refined] ...

A room is made from its own seed, ``--seed`` and on, so that a line about a faulty room says how to see it alone.
Nothing is passed or failed here.
"""

import argparse
import json
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields, replace
from functools import partial
from operator import attrgetter

import numpy as np
from google.protobuf.json_format import MessageToDict, Parse
from mapper.judge import Errors, Verdict, judge
from mapper.room import (
    HARD,
    PAPER,
    PLAIN,
    LabelledSweep,
    Physics,
    Room,
    message_of,
    paper_path,
    paper_room,
    random_room,
    survey_labelled,
)
from scipy.stats import chi2

from noctule.messages_pb2 import Sweep
from noctule_mapper.config import MapperConfig
from noctule_mapper.estimate import Contour
from noctule_mapper.mapper import Mapper
from noctule_mapper.sweep import SweepReadings, from_message

Made = tuple[Room, np.ndarray, Physics]


def paper(rng: np.random.Generator) -> Made:  # noqa: ARG001 -- one room, whatever the seed
    """The paper's room, path and noise."""
    return paper_room(), paper_path(), PAPER


def random(rng: np.random.Generator) -> Made:
    """A random room; the ranges' spread is 1 to 3.2 mm."""
    room, poses = random_room(rng)
    return room, poses, replace(PLAIN, sigma_m=float(rng.uniform(0.001, 0.0032)))


def hard(rng: np.random.Generator) -> Made:
    """A random room with uncertain poses, false, lost and late echoes."""
    return *random_room(rng), HARD


KINDS: dict[str, Callable[[np.random.Generator], Made]] = {"paper": paper, "random": random, "hard": hard}


@dataclass(frozen=True)
class Run:
    """One room: its seed, the verdict, and the processor's time for sweeps and contour."""

    seed: int
    verdict: Verdict
    fit_ms: float
    contour: Contour


def surveyed(kind: str, seed: int, calibrated: bool) -> tuple[Room, list[LabelledSweep], list[SweepReadings]]:
    """A room, its labelled survey, and what the mapper gets of it: read from lines of JSON, at 5 to 35 degrees."""
    rng = np.random.default_rng(seed)
    room, poses, physics = KINDS[kind](rng)
    labelled = survey_labelled(room, poses, rng, physics, calibrated)
    celsius = float(rng.uniform(5, 35))
    lines = [json.dumps(MessageToDict(message_of(one.sweep, celsius))) for one in labelled]
    return room, labelled, [from_message(Parse(line, Sweep())) for line in lines]


def run(seed: int, kind: str, method: str, calibrated: bool) -> Run:
    """Map one room and judge the contour."""
    room, labelled, sweeps = surveyed(kind, seed, calibrated)
    mapper = Mapper(MapperConfig.model_validate({"method": method}))
    began_s = time.process_time()
    for sweep in sweeps:
        mapper.register_sweep(sweep)
    contour = mapper.contour()
    fit_ms = 1000 * (time.process_time() - began_s)
    return Run(seed, judge(contour, room, labelled), fit_ms, contour)


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
    """Mean errors and their ratios; the ratio by weight is of root mean squares, each error over its sigma, lest one
    thing that the echoes hardly determine outweigh all the others.
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
