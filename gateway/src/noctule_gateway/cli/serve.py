"""What ``run`` does: a gateway, its session of the bus and its metrics, from the first line of the log to the last."""

import logging
import sys
from dataclasses import dataclass
from pathlib import Path

import zenoh

from noctule import bus, bus_config, firmware_rules, metrics, metrics_server, site, tls
from noctule.bus_watch import BusWatch
from noctule.ending import Ending
from noctule.systemd import ServiceManager
from noctule_gateway.limits import allow_files
from noctule_gateway.log.log_file import Retention
from noctule_gateway.service import Gateway
from noctule_gateway.update.admission import Admission

_REPORT_EVERY_S = 1.0
# A thread that computes, for a client of the logs, gives way after so long to one that has a sweep. Python's 5 ms would
# be waited at each step of the sweep's way: line, log, outbox.
_GIVES_WAY_AFTER_S = 0.001

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Access:
    """How the gateway joins the bus, and where it shows its metrics."""

    connect: list[str]
    listen: list[str]
    tls_folder: Path | None
    firmware: Path | None
    metrics_at: str | None


def serve(site_file: Path, data: Path, name: str, retention: Retention, access: Access, ending: Ending) -> None:
    """Serve the units of the site file until ``ending``, whatever becomes of the bus. Raises NoctuleError, OSError."""
    sys.setswitchinterval(_GIVES_WAY_AFTER_S)
    served = site.load(site_file)
    if warning := allow_files(len(served.units)):
        _log.warning("%s", warning)
    gateway = Gateway(served, data, name, retention, admission=_admission(access))
    manager = ServiceManager()
    session: zenoh.Session | None = None

    def look_after() -> None:
        if ending.begun.is_set():
            raise KeyboardInterrupt
        gateway.report()
        manager.serving(gateway.summary, gateway.makes_progress)

    def open_session() -> zenoh.Session:
        return bus.open_session(access.connect, access.listen, tls_folder=access.tls_folder, while_waiting=look_after)

    try:
        config = bus_config.config(access.connect, access.listen, tls.chosen(access.tls_folder))
        is_router = bus_config.is_router(config)
        with metrics_server.serving(access.metrics_at, metrics.registry(gateway.statuses)):
            # A router's port may be taken: then the units are another gateway's, and their lines stay shut.
            session = open_session() if is_router else None
            gateway.start()
            session = session or open_session()
            watch = BusWatch(session, access.connect, access.listen, access.tls_folder)
            gateway.join(session, watch, access.tls_folder)
            where = access.listen or access.connect or [f"as {access.tls_folder} says"]
            _log.info("on the bus: %s", f"the router at {', '.join(where)}" if access.listen else ", ".join(where))
            while True:
                look_after()
                ending.begun.wait(_REPORT_EVERY_S)
    except KeyboardInterrupt:
        _log.info("stopping")
    finally:
        ending.begin()
        manager.stopping()
        gateway.close()
        if session is not None:
            session.close()
        _log.info("stopped")


def _admission(access: Access) -> Admission:
    is_local = bus_config.is_local(access.connect, access.listen, access.tls_folder)
    admission = Admission(firmware_rules.chosen(access.firmware, access.tls_folder), takes_unsigned=is_local)
    _log.log(logging.INFO if admission.rules or is_local else logging.WARNING, "firmware: %s", admission)
    return admission
