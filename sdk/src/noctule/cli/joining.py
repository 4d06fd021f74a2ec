"""How the commands join a site."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from noctule import bus, keys, sites, tls
from noctule.client import Client
from noctule.errors import NotServedError, SilenceError
from noctule.unit_list import natural

SHORT_PATIENCE_S = 2.0  # for commands that someone waits for
_MOST_NAMED = 20


def what_there_is(client: Client) -> str:
    """For one who has mistyped a name: which units the site has, and which other sites there are."""
    try:
        units = sorted(client.units(), key=natural)
    except SilenceError:  # must not replace the error that this is said beside
        units = []
    if len(units) > _MOST_NAMED:
        units = [*units[:_MOST_NAMED], "..."]
    others = [site for site in sites.on_bus(client.session) if site != client.site]
    told = f" Units of site {client.site!r}: {', '.join(units)}." if units else ""
    return f"{told} Sites on the bus: {', '.join(others)}." if others else told


def nothing_found(client: Client, tls_folder: Path | None) -> str:
    """The same for one who finds nothing of a site; and that routers hide what one may not read."""
    identity = tls.chosen(tls_folder)
    told = what_there_is(client)
    return told if identity is None else f"{told} May {identity.common_name} read this site?"


@contextmanager
def joined(site: str, connect: list[str], tls_folder: Path | None) -> Iterator[Client]:
    """A client of ``site``. Raises BusError, and KeyFormatError before a router is asked. A NotServedError of the block
    says what there is instead.
    """
    keys.name(site, "site")
    with (
        bus.closing(bus.open_session(connect, patience_s=SHORT_PATIENCE_S, tls_folder=tls_folder)) as session,
        Client(site, session=session, tls_folder=tls_folder) as client,
    ):
        try:
            yield client
        except NotServedError as error:
            raise NotServedError(f"{error}.{what_there_is(client)}") from error


@contextmanager
def joined_until(
    over: threading.Event, site: str, connect: list[str], tls_folder: Path | None, listen: Sequence[str] = ()
) -> Iterator[Client | None]:
    """A client of ``site``, however long its router is waited for; None where it is ``over`` before that. With
    ``listen`` it is the router. Raises KeyFormatError before a router is asked.
    """
    keys.name(site, "site")
    try:
        session = bus.open_session(
            [] if listen else connect, listen, tls_folder=tls_folder, while_waiting=lambda: _end_if(over)
        )
    except _OverError:
        yield None
        return
    with bus.closing(session), Client(site, session=session, tls_folder=tls_folder) as client:
        yield client


class _OverError(Exception):
    """It was over before a router answered."""


def _end_if(over: threading.Event) -> None:
    if over.is_set():
        raise _OverError
