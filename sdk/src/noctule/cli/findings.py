"""What ``doctor`` finds: all that it looks at, in the order in which one thing needs the other."""

import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from noctule.cli.joining import SHORT_PATIENCE_S
from noctule.doctor import clock, configuration, data_folder, joining, serial_ports
from noctule.doctor.finding import Finding, Level
from noctule.doctor.host import Host
from noctule.kernel_clock import kernel_clock


def findings_of(
    site_file: Path | None, data: list[Path], fleet: Path | None, connect: list[str], tls: Path | None
) -> Iterator[Finding]:
    """One thing after the other, as ``doctor`` looks at it."""
    host, site = Host(), None
    if site_file is not None:
        site, found = configuration.check_site(site_file)
        yield from found
    if fleet is not None:
        yield from configuration.check_fleet(fleet)
    yield from joining.check_certificates(tls, datetime.now(UTC))
    yield from joining.check_router(connect, tls, SHORT_PATIENCE_S)
    yield from _clock([path for path in (site_file, fleet, *data) if path is not None])
    if site is not None:
        yield from serial_ports.check(site.units, host)
    for folder in data:
        if folder.is_dir():
            yield from data_folder.check(folder, data_folder.room(folder), site and site.name, host)
        elif folder.exists():
            yield Finding(Level.FAULT, f"data folder {folder}", "is no folder: give what the service has as --data")
        else:
            text = "is not there: the service makes it at its first start, or correct the path"
            yield Finding(Level.WARNING, f"data folder {folder}", text)


def _clock(files: list[Path]) -> Iterator[Finding]:
    newest_s = max((file.stat().st_mtime for file in files if file.exists()), default=0.0)
    try:
        yield from clock.check(kernel_clock(), time.time(), newest_s)
    except OSError as error:
        yield Finding(Level.WARNING, "clock", f"the kernel does not say whether it is synchronised ({error.strerror})")
