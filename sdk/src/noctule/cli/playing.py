"""What ``replay`` does: publish a survey as its units would, and wait for those who read it."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from threading import Event
from time import monotonic

import typer

from noctule import awake, bus, survey
from noctule.cli.joining import joined_until
from noctule.client import Client
from noctule.errors import BusError
from noctule.messages_pb2 import Sweep
from noctule.progress import Progress, progress
from noctule.replay import Readers, Replay

_LOOK_EVERY_S = 0.1


def play(
    file: Path,
    site: str,
    speed: float,
    connect: list[str],
    tls: Path | None,
    listen: Sequence[str],
    timeout_s: float | None,
) -> None:
    """Publish ``file`` as ``site``, ``speed`` times as fast, and stay until Ctrl-C, or until all who read it have.

    They may take ``timeout_s``, then BusError is raised; None: stay. Raises OSError where there is no such file.
    """
    with file.open("rb"):  # else a mistyped name would wait for a router
        pass
    with (
        awake.told_to_end() as over,
        joined_until(over, site, connect, tls, listen) as client,
        progress() as shown,
    ):
        if client is None:
            return
        readers = Readers(client)
        schemas = bus.declare_schemas(client.session)
        playing = Replay(client.session, site)
        try:
            _check_that_nobody_serves_it(file, shown, client, over)
            playing.run(_counted(file, shown), None if speed == math.inf else speed, over)
            if over.is_set():
                return
            typer.echo(f"{file} has been published", err=True)
            shown.at("published; Ctrl-C ends it")
            if timeout_s is None:
                playing.wait(math.inf, over)
            else:
                _wait_for(readers, playing, timeout_s, over)
        finally:
            playing.close()
            schemas.undeclare()


def _check_that_nobody_serves_it(file: Path, shown: Progress, client: Client, over: Event) -> None:
    """Raises BusError where somebody serves a unit of ``file``: the two would mix."""
    served = client.units()
    if not served:
        return
    for number, unit in enumerate(survey.read_units(file)):
        if over.is_set():
            return
        if unit in served:
            raise BusError(
                f"unit {unit!r} of site {client.site!r} is served already: replay it as another site,"
                " or end the program that serves it"
            )
        shown.at("looking for units that are served", number)


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
