"""The command that looks for what keeps a host from working, and says what to do."""

import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from noctule.cli.joining import DEFAULT_CONNECT, SHORT_PATIENCE_S, Connect, Tls
from noctule.doctor import clock, configuration, data_folder, joining, serial_ports
from noctule.doctor.finding import Finding, Level, exit_status
from noctule.doctor.host import Host
from noctule.kernel_clock import kernel_clock
from noctule.plain_text import plain

DataFolders = Annotated[
    list[Path] | None, typer.Option("--data", metavar="FOLDER", help="A gateway's or mapper's data.")
]


def doctor(
    site_file: Annotated[Path | None, typer.Argument(metavar="[SITE.toml]", help="The gateway's site file.")] = None,
    data: DataFolders = None,
    fleet: Annotated[Path | None, typer.Option(metavar="FLEET.toml", help="The fleet file of noctule-deploy.")] = None,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
) -> None:
    """Check files, certificates, router, clock, serial ports and disk, and say what to do.

    Exit status: 0 all is well, 1 a fault, 3 warnings only.
    """
    findings = []
    for finding in _findings(site_file, data or [], fleet, connect, tls):
        typer.echo(plain(f"{finding.level.value:<8} {finding.about}: {finding.text}"))
        findings.append(finding)
    raise typer.Exit(exit_status(findings))


def _findings(
    site_file: Path | None, data: list[Path], fleet: Path | None, connect: list[str], tls: Path | None
) -> Iterator[Finding]:
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
        else:
            text = "is not there: the service makes it at its first start, or correct the path"
            yield Finding(Level.WARNING, f"data folder {folder}", text)


def _clock(files: list[Path]) -> Iterator[Finding]:
    newest_s = max((file.stat().st_mtime for file in files if file.exists()), default=0.0)
    try:
        yield from clock.check(kernel_clock(), time.time(), newest_s)
    except OSError as error:
        yield Finding(Level.WARNING, "clock", f"the kernel does not say whether it is synchronised ({error.strerror})")
