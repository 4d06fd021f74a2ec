"""How the commands join a site."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from noctule import bus
from noctule.client import Client

SHORT_PATIENCE_S = 2.0  # for commands that someone waits for

Connect = Annotated[
    list[str],
    typer.Option(envvar="NOCTULE_CONNECT", metavar="ENDPOINT", help="A router, or one of several to fall back on."),
]
SiteName = Annotated[str, typer.Argument(metavar="SITE", help="The site's name.")]
UnitName = Annotated[str, typer.Argument(metavar="UNIT", help="The unit's name.")]
DEFAULT_CONNECT = [bus.DEFAULT_ROUTER]


@contextmanager
def joined(site: str, connect: list[str], patience_s: float | None = SHORT_PATIENCE_S) -> Iterator[Client]:
    """A client of ``site``; None waits for a router for ever. Raises BusError."""
    with bus.open_session(connect, patience_s=patience_s) as session, Client(site, session=session) as client:
        yield client
