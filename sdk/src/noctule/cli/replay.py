"""The command that puts a survey on the bus."""

import math
from pathlib import Path
from typing import Annotated

import typer

from noctule.cli.options import DEFAULT_CONNECT, Connect
from noctule.program_options import ENDPOINT, NAME, Tls


def _speed(text: str) -> float:
    if text == "max":
        return math.inf
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not 0.0 < speed < math.inf:
        raise typer.BadParameter(f"{text!r} is neither a number above 0 nor max")
    return speed


def replay(
    file: Annotated[Path, typer.Argument(metavar="SURVEY", help="JSON lines or MCAP of sweeps.")],
    site: Annotated[str, typer.Option(callback=NAME, help="The site to replay it as.")],
    speed: Annotated[float, typer.Option(parser=_speed, metavar="X|max", help="How many times as fast.")] = 1.0,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    listen: Annotated[
        list[str] | None, typer.Option(metavar="ENDPOINT", callback=ENDPOINT, help="Be the router, here.")
    ] = None,
    exit_when_done: Annotated[
        bool, typer.Option("--exit-when-done", help="End when the services that read it have read it all.")
    ] = False,
    timeout_s: Annotated[
        float, typer.Option("--timeout", help="With --exit-when-done: how many seconds they may take.")
    ] = 60.0,
) -> None:
    """Put a survey on the bus as if its units were sweeping now; stays until Ctrl-C."""
    from noctule.cli.playing import play

    play(file, site, speed, connect, tls, listen or [], timeout_s if exit_when_done else None)
