"""The command that prints all that is known of one unit, to be filed with it."""

from pathlib import Path
from typing import Annotated

import typer

from noctule.cli.options import DEFAULT_CONNECT, Connect, SiteName, UnitName
from noctule.errors import ReportError
from noctule.plain_text import plain
from noctule.program_options import Tls, check_folders


def unit_report(
    site: SiteName,
    unit: UnitName,
    sweeps: Annotated[int, typer.Option(help="How many of its last sweeps are looked at.", min=0, max=500)] = 50,
    output: Annotated[Path | None, typer.Option(help="Write it into this file too.")] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object.")] = False,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
) -> None:
    """Print all that is known of a unit: versions, settings, counters, clock, health, and its sweeps by bearing."""
    from noctule.cli.joining import joined
    from noctule.cli.report_lines import report_lines, summary_of

    check_folders(output)
    with joined(site, connect, tls) as client:
        summary = summary_of(client, unit, sweeps)
    text = summary.to_json() if json else "\n".join(map(plain, report_lines(site, summary)))
    typer.echo(text)
    if output is not None:
        try:
            output.write_text(text + "\n")
        except OSError as error:
            raise ReportError(f"{output} can't be written: {error.strerror}") from error
