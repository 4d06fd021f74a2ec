"""The options that several programs have. They need typer, which the programs' packages bring."""

from pathlib import Path
from typing import Annotated

import typer

from noctule import logs, tls

Tls = Annotated[
    Path | None,
    typer.Option(
        "--tls",
        envvar=tls.FOLDER_VARIABLE,
        metavar="FOLDER",
        help="Certificate and key: a folder that noctule-deploy render made. It also names the routers.",
    ),
]
Metrics = Annotated[str | None, typer.Option("--metrics", metavar="HOST:PORT", help="Serve Prometheus metrics here.")]
Format = Annotated[
    logs.LogFormat,
    typer.Option("--log-format", envvar=logs.FORMAT_VARIABLE, help="The log as text, or as JSON lines."),
]


def version_option(distribution: str) -> object:
    """For ``Annotated[bool, ...]`` in the callback of a typer application: print name and version, and end."""

    def show(wanted: bool) -> None:
        if wanted:
            from importlib import metadata  # which loads a parser of e-mail

            typer.echo(f"{distribution} {metadata.version(distribution)}")
            raise typer.Exit

    return typer.Option("--version", callback=show, is_eager=True, help="Print the version and end.")
