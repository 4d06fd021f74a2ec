"""The command ``reproduce``: the paper's figures and tables, made again in simulation."""

import os
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from noctule.errors import NoctuleError


class MissingExtraError(NoctuleError):
    """A part of the mapper that was not installed with it; the message says which extra to install."""


def reproduce(
    out: Annotated[Path, typer.Option(help="Folder for report, figures and recording; made if need be.")],
    seeds: Annotated[int, typer.Option(min=2, help="How many surveys to simulate.")] = 50,
    seed: Annotated[int, typer.Option(min=0, help="The first one's seed; the others follow it.")] = 1,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; as many as processors by default.")] = None,
) -> None:
    """Reproduce the figures and tables of Liu et al. 2019 on simulated surveys."""
    if find_spec("matplotlib") is None:
        raise MissingExtraError(
            "reproduce draws with matplotlib, which is not there; install noctule-mapper[reproduce]"
        )
    # Only now: this loads matplotlib.
    from noctule_mapper.reproduction.reproduce import REPORT, reproduce_into

    results = reproduce_into(out, range(seed, seed + seeds), jobs or os.cpu_count() or 1)
    for method, one in results.comparisons.items():
        errors = one.corner_error, one.cylinder[3], one.cylinder[4]
        corner, centre, radius = (f"{error.mean:.2f} ± {error.deviation:.2f}" for error in errors)
        print(f"{method:8} corners {corner} cm, centre {centre} cm, radius {radius} cm; {one.missed} missed")
    print(f"simulated, {seeds} seeds from {seed}: {out / REPORT}")
