"""The options that several commands have, beside those of ``noctule.program_options``."""

from typing import Annotated

import typer

from noctule import endpoints
from noctule.program_options import ENDPOINT, NAME

Connect = Annotated[
    list[str],
    typer.Option(
        envvar="NOCTULE_CONNECT",
        metavar="ENDPOINT",
        callback=ENDPOINT,
        help=f"A router, or one of several to fall back on. Left out: those of --tls, or {endpoints.DEFAULT_ROUTER}.",
    ),
]
SiteName = Annotated[str, typer.Argument(metavar="SITE", callback=NAME, help="The site's name.")]
UnitName = Annotated[str, typer.Argument(metavar="UNIT", callback=NAME, help="The unit's name.")]
DEFAULT_CONNECT: list[str] = []
