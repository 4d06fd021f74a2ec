"""The command ``check``: what is wrong with the fleet file, and with what was rendered."""

from datetime import UTC, datetime

import typer

from noctule_deploy.cli.options import DEFAULT_FLEET, DEFAULT_OUT, Ca, FleetFile, Out, ca_folder, naming_files


def check(fleet: FleetFile = DEFAULT_FLEET, out: Out = DEFAULT_OUT, ca: Ca = None) -> None:
    """Name every mistake in the fleet file, and what is wrong with what was rendered.

    Exit status: 0 all is well, 1 something is wrong, 3 a certificate expires within 30 days.
    """
    from noctule_deploy import check as checking
    from noctule_deploy import fleet_file
    from noctule_deploy.render import Place

    with naming_files(out):
        findings = checking.check(fleet_file.load(fleet), Place(out, ca_folder(out, ca)), datetime.now(UTC))
    for each in findings:
        typer.echo(each.text)
    if not findings:
        typer.echo("all is well")
    raise typer.Exit(min((each.severity for each in findings), default=0))
