"""A gateway that serves model units, for tests: its site file, itself, and what a client sees of them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import zenoh

from noctule import elapsed, keys
from noctule.client import Client
from noctule.elapsed import Instant
from noctule.kernel_clock import KernelClock
from noctule.messages_pb2 import UnitStatus
from noctule.site import load
from noctule_gateway.service import Gateway

SITE = "test-site"
UNIT = """
[[unit]]
name = "{name}"
serial = {serial}
address = "{address}"
{more}
"""
RPC_ANY = keys.rpc(SITE, "u1", keys.ANY)
FIXED = "pose = { x_m = 1.0, y_m = 2.0, heading_deg = 90 }"


def site_file(folder: Path, *units: tuple[str, int, str, str], top: str = "air_temperature_c = 21.5") -> Path:
    """A site file of units (name, serial, address, pose and whatever else)."""
    path = folder / "site.toml"
    tables = [
        UNIT.format(name=name, serial=serial, address=address, more=more) for name, serial, address, more in units
    ]
    path.write_text(f'site = "{SITE}"\n{top}\n' + "".join(tables))
    return path


@contextmanager
def running(
    path: Path,
    data: Path,
    session: zenoh.Session,
    now: Callable[[], Instant] = elapsed.now,
    kernel_clock: Callable[[], KernelClock] = lambda: KernelClock(synchronised=True, most_error_s=0.01),
) -> Iterator[Gateway]:
    gateway = Gateway(load(path), data, now=now, kernel_clock=kernel_clock)
    try:
        gateway.start()
        gateway.join(session)
        gateway.report()
        yield gateway
    finally:
        gateway.close()


def unit_status(client: Client, unit: str = "u1") -> UnitStatus:
    return next((status for status in client.unit_statuses() if status.unit == unit), UnitStatus())


def connected(client: Client, unit: str = "u1") -> bool:
    away = (UnitStatus.STATE_UNSPECIFIED, UnitStatus.STATE_DISCONNECTED, UnitStatus.STATE_LOADER)
    return unit_status(client, unit).state not in away
