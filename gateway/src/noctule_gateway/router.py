"""The router of a bus as a process of its own: what breaks in it breaks no gateway, and it is started again alone."""

import logging
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from noctule import bus, bus_config, metrics, metrics_server, tls
from noctule.ending import Ending
from noctule.errors import BusConfigError
from noctule.expiry_watch import ExpiryWatch
from noctule.messages_pb2 import ServiceStatus
from noctule.systemd import ServiceManager

_REPORT_EVERY_S = 1.0
_VERSION = version("noctule-gateway")

_log = logging.getLogger(__name__)


def serve(
    listen: Sequence[str], connect: Sequence[str], tls_folder: Path | None, metrics_at: str | None, ending: Ending
) -> None:
    """Pass on what members of the bus say, until ``ending`` begins; linked to the routers ``connect``.

    The log says each day that the certificate expires soon. Raises BusConfigError, BusError, MetricsError, TlsError.
    """
    identity = tls.chosen(tls_folder)
    config = bus_config.config(connect, listen, identity)
    if identity is not None and not bus_config.is_router(config):
        raise BusConfigError(f"{identity.common_name} is a client's and not a router's: give the folder of a router")
    manager, expiry = ServiceManager(), ExpiryWatch(identity)
    latest = _status(identity, 0)
    session = bus.open_session(connect, listen, tls_folder=tls_folder)
    try:
        with metrics_server.serving(metrics_at, metrics.registry(lambda: [latest])):
            _log.info("the router listens on %s", ", ".join(bus_config.endpoints_of(config, "listen")))
            while not ending.begun.is_set():
                members, alarm = len(session.info.transports()), expiry.look(datetime.now(UTC))
                latest = _status(identity, members)
                manager.serving("; ".join(filter(None, (f"{members} members connected", alarm))))
                ending.begun.wait(_REPORT_EVERY_S)
            _log.info("stopping")
    finally:
        ending.begin()
        manager.stopping()
        session.close()


def _status(identity: tls.Identity | None, members: int) -> ServiceStatus:
    """For the metrics alone: a router publishes nothing."""
    name = (identity and identity.name) or "router"
    made = ServiceStatus(name=name, role="router", version=_VERSION, counters={"members": members})
    made.time.GetCurrentTime()
    return made
