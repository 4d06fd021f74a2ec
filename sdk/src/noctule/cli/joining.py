"""How the commands join a site."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from noctule import bus, sites, tls
from noctule.client import Client

SHORT_PATIENCE_S = 2.0  # for commands that someone waits for

Connect = Annotated[
    list[str],
    typer.Option(
        envvar="NOCTULE_CONNECT",
        metavar="ENDPOINT",
        help=f"A router, or one of several to fall back on. Left out: those of --tls, or {bus.DEFAULT_ROUTER}.",
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


def nothing_found(client: Client, tls_folder: Path | None) -> str:
    """For one who finds nothing of a site: which others there are, and that routers hide what one may not read."""
    others = [site for site in sites.on_bus(client.session) if site != client.site]
    told = f" Sites on the bus: {', '.join(others)}." if others else ""
    identity = tls.chosen(tls_folder)
    return told if identity is None else f"{told} May {identity.common_name} read this site?"


@contextmanager
def joined(
    site: str, connect: list[str], tls_folder: Path | None, patience_s: float | None = SHORT_PATIENCE_S
) -> Iterator[Client]:
    """A client of ``site``; None waits for a router for ever. Raises BusError."""
    with (
        bus.open_session(connect, patience_s=patience_s, tls_folder=tls_folder) as session,
        Client(site, session=session, tls_folder=tls_folder) as client,
    ):
        yield client
