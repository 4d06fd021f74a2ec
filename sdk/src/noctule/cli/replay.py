"""The command that puts a survey on the bus."""

import math
from collections.abc import Iterator
from pathlib import Path
from threading import Event
from time import monotonic
from typing import Annotated

import typer

from noctule import awake, bus, survey
from noctule.cli.joining import DEFAULT_CONNECT, Connect, Tls, joined_until
from noctule.errors import BusError
from noctule.messages_pb2 import Sweep
from noctule.progress import Progress, progress
from noctule.replay import Readers, Replay

_LOOK_EVERY_S = 0.1


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
    file: Annotated[
        Path, typer.Argument(metavar="SURVEY", help="JSON lines or MCAP of sweeps.", exists=True, dir_okay=False)
    ],
    site: Annotated[str, typer.Option(help="The site to replay it as.")],
    speed: Annotated[float, typer.Option(parser=_speed, metavar="X|max", help="How many times as fast.")] = 1.0,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    listen: Annotated[list[str] | None, typer.Option(metavar="ENDPOINT", help="Be the router, here.")] = None,
    exit_when_done: Annotated[bool, typer.Option(help="End when the services that read it have read it all.")] = False,
    timeout_s: Annotated[
        float, typer.Option("--timeout", help="With --exit-when-done: how long they may take.")
    ] = 60.0,
) -> None:
    """Put a survey on the bus as if its units were sweeping now; stays until Ctrl-C."""
    with (
        awake.told_to_end() as over,
        joined_until(over, site, connect, tls, listen or []) as client,
        progress() as shown,
    ):
        if client is None:
            return
        readers = Readers(client)
        schemas = bus.declare_schemas(client.session)
        playing = Replay(client.session, site)
        try:
            playing.run(_counted(file, shown), None if speed == math.inf else speed, over)
            if over.is_set():
                return
            typer.echo(f"{file} has been published", err=True)
            shown.at("published; Ctrl-C ends it")
            if not exit_when_done:
                playing.wait(math.inf, over)
            else:
                _wait_for(readers, playing, timeout_s, over)
        finally:
            playing.close()
            schemas.undeclare()


def _counted(file: Path, shown: Progress) -> Iterator[Sweep]:
    for number, sweep in enumerate(survey.read(file)):
        shown.at("publishing sweeps", number)
        yield sweep


def _wait_for(readers: Readers, playing: Replay, within_s: float, over: Event) -> None:
    """Wait until all who read the units have read them, or until ``over``. Raises BusError after ``within_s``."""
    until_s = monotonic() + within_s
    while not (readers.have_passed(playing.heads()) or over.is_set()):
        if monotonic() > until_s:
            raise BusError(f"after {within_s:g} s no service shows that it has read all: is a mapper of the site up?")
        playing.wait(monotonic() + _LOOK_EVERY_S, over)
