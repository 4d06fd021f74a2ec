"""The options that the live commands have in common."""

from pathlib import Path
from typing import Annotated

import typer

from noctule.logs import FORMAT_VARIABLE, LogFormat

Connect = Annotated[list[str] | None, typer.Option(help="A Zenoh router; may be given several times.")]
Rerun = Annotated[
    str, typer.Option(help="The Rerun relay, or 'none'; with #sites behind it if that relay shows several sites.")
]
Config = Annotated[Path | None, typer.Option(help="TOML file of parameters.")]
Tls = Annotated[
    Path | None,
    typer.Option(
        envvar="NOCTULE_TLS", metavar="FOLDER", help="Certificate and key: a folder that noctule-deploy made."
    ),
]
Metrics = Annotated[str | None, typer.Option(metavar="HOST:PORT", help="Serve Prometheus metrics here.")]
Format = Annotated[LogFormat, typer.Option(envvar=FORMAT_VARIABLE, help="The log as text, or as JSON lines.")]


def relay(rerun: str) -> str | None:
    """The relay's address; None where nobody watches."""
    return None if rerun == "none" else rerun
