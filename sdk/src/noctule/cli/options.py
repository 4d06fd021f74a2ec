"""The options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

from noctule import endpoints, tls

Connect = Annotated[
    list[str],
    typer.Option(
        envvar="NOCTULE_CONNECT",
        metavar="ENDPOINT",
        help=f"A router, or one of several to fall back on. Left out: those of --tls, or {endpoints.DEFAULT_ROUTER}.",
    ),
]
Tls = Annotated[
    Path | None,
    typer.Option(
        "--tls",
        envvar=tls.FOLDER_VARIABLE,
        metavar="FOLDER",
        help="Certificate and key: a folder that noctule-deploy render made.",
    ),
]
SiteName = Annotated[str, typer.Argument(metavar="SITE", help="The site's name.")]
UnitName = Annotated[str, typer.Argument(metavar="UNIT", help="The unit's name.")]
DEFAULT_CONNECT: list[str] = []
