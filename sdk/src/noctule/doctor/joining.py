"""What a program needs to join the bus: certificates, and a router that lets it in."""

from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path

from noctule import bus, bus_config, endpoints, tls
from noctule.doctor.finding import Finding, Level
from noctule.errors import BusError, TlsError


def check_certificates(folder: Path | None, now: datetime) -> Iterator[Finding]:
    """Whether the folder of ``--tls`` is whole, private, of one issue, and valid for 30 days more."""
    try:
        identity = tls.chosen(folder, now)
    except TlsError as error:
        yield Finding(Level.FAULT, "certificates", str(error))
        return
    if identity is None:
        yield Finding(Level.OK, "certificates", "none are used: the bus is open to all who reach its router")
    elif alarm := identity.expiry_alarm(now):
        yield Finding(Level.WARNING, "certificates", alarm)
    else:
        text = f"{identity.common_name}, valid until {identity.expires:%Y-%m-%d}"
        yield Finding(Level.OK, "certificates", text)


def check_router(connect: Sequence[str], folder: Path | None, patience_s: float) -> Iterator[Finding]:
    """Join the bus once, with the router's name and certificate checked."""
    try:
        bus.open_session(connect, patience_s=patience_s, tls_folder=folder).close()
    except BusError as error:
        yield Finding(Level.FAULT, "router", str(error))
        return
    where = endpoints.shown(connect) if connect else "the folder's routers" if folder else bus_config.DEFAULT_ROUTER
    yield Finding(Level.OK, "router", f"reached by {where}")
