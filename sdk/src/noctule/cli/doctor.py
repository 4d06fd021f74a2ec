"""The command that looks for what keeps a host from working, and says what to do."""

from pathlib import Path
from typing import Annotated

import typer

from noctule.cli.options import DEFAULT_CONNECT, Connect
from noctule.plain_text import plain
from noctule.program_options import Tls

DataFolders = Annotated[
    list[Path] | None, typer.Option("--data", metavar="FOLDER", help="A gateway's or mapper's data.")
]


def doctor(
    site_file: Annotated[Path | None, typer.Argument(metavar="SITE.toml", help="The gateway's site file.")] = None,
    data: DataFolders = None,
    fleet: Annotated[Path | None, typer.Option(metavar="FLEET.toml", help="The fleet file of noctule-deploy.")] = None,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
) -> None:
    """Check files, certificates, router, clock, serial ports and disk, and say what to do.

    Exit status: 0 all is well, 1 a fault, 3 warnings only.
    """
    from noctule.cli.findings import findings_of
    from noctule.doctor.finding import exit_status

    findings = []
    for finding in findings_of(site_file, data or [], fleet, connect, tls):
        typer.echo(plain(f"{finding.level.value:<8} {finding.about}: {finding.text}"))
        findings.append(finding)
    raise typer.Exit(exit_status(findings))
