"""The command ``reproduce``: the paper's figures and tables, made again in simulation by a package of its own."""

import os
from pathlib import Path
from typing import Annotated

import typer

from noctule.errors import NoctuleError


class MissingPackageError(NoctuleError):
    """A command whose work is in a package that is not installed; the message names the package."""


def reproduce(
    out: Annotated[Path, typer.Option(help="Folder for report, figures and recording; made if need be.")],
    seeds: Annotated[int, typer.Option(min=2, help="How many surveys to simulate.")] = 50,
    seed: Annotated[int, typer.Option(min=0, help="The first one's seed; the others follow it.")] = 1,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; as many as processors by default.")] = None,
) -> None:
    """Reproduce the figures and tables of Liu et al. 2019 on simulated surveys."""
    from importlib.metadata import entry_points

    # A researcher installs the package, the host of a mapper does not: it brings matplotlib.
    found = entry_points(group="noctule_mapper.commands", name="reproduce")
    if not found:
        raise MissingPackageError(
            "reproduce simulates and draws with the package noctule-reproduction, which is not installed; "
            "make setup in the project's folder installs it"
        )
    (command,) = found
    command.load()(out, range(seed, seed + seeds), jobs or os.cpu_count() or 1)
