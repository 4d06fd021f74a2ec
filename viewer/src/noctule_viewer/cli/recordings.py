"""The commands ``open`` and ``days``: the map that the relay shows, or a recording of it, and what is recorded."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated
from urllib.parse import urlsplit

import typer

from noctule.endpoints import LAST_PORT
from noctule.errors import NoctuleError
from noctule_viewer.address import DEFAULT_BIND, DEFAULT_PAGE, DEFAULT_URL, DEFAULT_WEB_PORT
from noctule_viewer.cli.failing import fail
from noctule_viewer.recordings.days import RecordingsError, chosen, recorded

_RELAY_SCHEMES = ("rerun+http://", "rerun+https://", "rerun://")


def open_(
    recordings: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="FILE.rrd|FOLDER", help="Recordings in place of the relay, or the folder of a recorder."
        ),
    ] = None,
    day: Annotated[
        str | None, typer.Option(metavar="YYYY-MM-DD", help="Of a folder: this day, in place of the last.")
    ] = None,
    url: Annotated[str, typer.Option(help="The relay's address, as mappers have it by --rerun.")] = DEFAULT_URL,
    web_port: Annotated[
        int, typer.Option(min=1, max=LAST_PORT, help="Port of the relay's page, which is asked for its version.")
    ] = DEFAULT_WEB_PORT,
) -> None:
    """Open the native viewer, or, where there is no screen, print the address for a browser.

    A relay with another version of Rerun is named first.
    """
    if not url.startswith(_RELAY_SCHEMES):
        fail(f"{url} is no relay: give {DEFAULT_URL}, with your relay's host and port", 2)
    given = recordings or []
    if day is not None and not (len(given) == 1 and given[0].suffix != ".rrd"):
        fail("--day needs the folder that noctule-viewer run --record writes to", 2)
    try:
        files = _files(given, day)
    except NoctuleError as error:
        fail(str(error))
    if not files and (differs := _differs(url, web_port)):
        print(f"noctule-viewer: {differs}", file=sys.stderr)
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        print(_without_screen(files, url))
        return
    from noctule_viewer.relay import environment

    rerun, *arguments = native_viewer(files, url)
    os.execve(rerun, [rerun, *arguments], environment())


def native_viewer(files: Sequence[Path], url: str) -> list[str]:
    """The command that shows ``files``, or the relay at ``url`` where there are none. Of a relay it keeps as much as a
    page does. Of recordings it keeps what fits in three quarters of the computer's memory, which is Rerun's default.
    """
    from noctule_viewer.page import PAGE_MEMORY
    from noctule_viewer.relay import RERUN

    shown = [str(file.resolve()) for file in files] or [url, "--memory-limit", PAGE_MEMORY]
    return [str(RERUN), *shown, "--bind", "127.0.0.1", "--port", "0"]


def days(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Where noctule-viewer run --record has recorded.")],
) -> None:
    """List the days that were recorded, and how large they are."""
    try:
        found = recorded(folder)
    except NoctuleError as error:
        fail(str(error))
    for day in found:
        print(f"{day.name} {day.size_bytes / 1e6:8.1f} MB")


def _files(recordings: Sequence[Path], day: str | None) -> list[Path]:
    """The files to open, none for the relay. Raises RecordingsError."""
    if len(recordings) == 1 and recordings[0].is_dir():
        return list(chosen(recordings[0], day).files)
    for each in recordings:
        if not each.is_file():
            raise RecordingsError(f"there is no file {each}: give a recording, or a folder of them")
    return list(recordings)


def _differs(url: str, web_port: int) -> str:
    """What is to be said of the relay's version; empty where nothing is."""
    from importlib.metadata import version

    from noctule_viewer import rerun_versions

    host = urlsplit(url).hostname or DEFAULT_BIND
    return rerun_versions.of_native_viewer(version("rerun-sdk"), rerun_versions.ask(host, web_port))


def _without_screen(recordings: Sequence[Path], url: str) -> str:
    if recordings:
        files, names = " ".join(map(str, recordings)), " ".join(file.name for file in recordings)
        return f"There is no screen here. Copy {files} to where there is one: noctule-viewer open {names}"
    return f"There is no screen here. Connect a Rerun viewer to {url}, or open {DEFAULT_PAGE} in a browser."
