"""The options that the live commands have in common."""

from pathlib import Path
from typing import Annotated

import typer

from noctule.program_options import ENDPOINT, checked
from noctule_mapper.rerun_view.address import host_and_port


def _relay(rerun: str) -> None:
    if rerun != "none":
        host_and_port(rerun)


Connect = Annotated[
    list[str] | None, typer.Option(metavar="ENDPOINT", callback=ENDPOINT, help="A router; give more for a fallback.")
]
Rerun = Annotated[
    str,
    typer.Option(
        callback=checked(_relay),
        help="The Rerun relay, or 'none'; with #sites behind it if that relay shows several sites.",
    ),
]
Config = Annotated[Path | None, typer.Option(help="TOML file of parameters, such as SITE.config.toml in --data.")]


def relay(rerun: str) -> str | None:
    """The relay's address; None where nobody watches."""
    return None if rerun == "none" else rerun
