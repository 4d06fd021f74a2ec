"""The options that several commands have, beside those of ``noctule.program_options``."""

from typing import Annotated

import typer

from noctule import endpoints

Connect = Annotated[
    list[str],
    typer.Option(
        envvar="NOCTULE_CONNECT",
        metavar="ENDPOINT",
        help=f"A router, or one of several to fall back on. Left out: those of --tls, or {endpoints.DEFAULT_ROUTER}.",
    ),
]
SiteName = Annotated[str, typer.Argument(metavar="SITE", help="The site's name.")]
UnitName = Annotated[str, typer.Argument(metavar="UNIT", help="The unit's name.")]
DEFAULT_CONNECT: list[str] = []
