"""The router of a bus as a process of its own: what breaks in it breaks no gateway, and it is started again alone."""

import logging
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from noctule import bus, bus_config, tls
from noctule.ending import Ending
from noctule.errors import BusConfigError
from noctule.expiry_watch import ExpiryWatch
from noctule.systemd import ServiceManager

_REPORT_EVERY_S = 1.0

_log = logging.getLogger(__name__)


def serve(listen: Sequence[str], connect: Sequence[str], tls_folder: Path | None, ending: Ending) -> None:
    """Pass on what members of the bus say, until ``ending`` begins; linked to the routers ``connect``.

    The log says each day that the certificate expires soon. Raises BusConfigError, BusError, TlsError.
    """
    identity = tls.chosen(tls_folder)
    config = bus_config.config(connect, listen, identity)
    if not bus_config.is_router(config):
        name = identity.common_name if identity else "the configuration"
        raise BusConfigError(f"{name} is a client's and no router's: give --listen, or the folder of a router")
    manager, expiry = ServiceManager(), ExpiryWatch(identity)
    session = bus.open_session(connect, listen, tls_folder=tls_folder)
    try:
        _log.info("the router listens on %s", ", ".join(bus_config.endpoints_of(config, "listen")))
        while not ending.begun.is_set():
            members = f"{len(session.info.transports())} members connected"
            manager.serving("; ".join(filter(None, (members, expiry.look(datetime.now(UTC))))))
            ending.begun.wait(_REPORT_EVERY_S)
        _log.info("stopping")
    finally:
        ending.begin()
        manager.stopping()
        session.close()
