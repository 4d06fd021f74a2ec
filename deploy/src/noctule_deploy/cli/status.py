"""The command ``status``: how every program of the fleet fares."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from noctule_deploy.cli.options import DEFAULT_FLEET, DEFAULT_OUT, FleetFile, Out, ca_folder, naming_files


def status(
    fleet: FleetFile = DEFAULT_FLEET,
    out: Out = DEFAULT_OUT,
    tls_folder: Annotated[
        Path | None,
        typer.Option("--tls", metavar="FOLDER", help="Certificate and key; those of an operator in --out if left out."),
    ] = None,
) -> None:
    """Show how every program of the fleet fares, by what it says on the bus.

    Exit status: 0 all is well, 1 something is not, 3 a certificate expires within 30 days.
    """
    from noctule_deploy import fleet_file, generations
    from noctule_deploy import status as fleet_status
    from noctule_deploy.cli.status_table import show
    from noctule_deploy.render import Place

    with naming_files(out):
        read, place = fleet_file.load(fleet), Place(out, ca_folder(out, None))
        known = generations.load(out)
        folder = tls_folder or fleet_status.own_folder(read, place, known)
        heard = fleet_status.listen(read, folder)
        rows = fleet_status.rows(read, heard, fleet_status.expiries(read, place, known), datetime.now(UTC))
    show(rows)
    bad = {each.state for each in rows} - {fleet_status.State.WELL}
    raise typer.Exit(0 if not bad else 3 if bad == {fleet_status.State.EXPIRES} else 1)
