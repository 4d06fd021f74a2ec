"""The commands ``render``, ``renew`` and ``revoke``: all that the hosts need, and new certificates of one name."""

from datetime import UTC, datetime
from typing import Annotated

import typer

from noctule_deploy.cli.options import DEFAULT_FLEET, DEFAULT_OUT, Ca, FleetFile, Out, ca_folder, naming_files

Subject = Annotated[str, typer.Argument(metavar="NAME", help="Role and name, as in gateway.attic.")]


def render(fleet: FleetFile = DEFAULT_FLEET, out: Out = DEFAULT_OUT, ca: Ca = None) -> None:
    """Make the authority, all certificates and access rules, and a folder for each host with what it needs.

    What is right already is left as it is.
    """
    from noctule_deploy import fleet_file
    from noctule_deploy.cli.changes import tell
    from noctule_deploy.render import Place
    from noctule_deploy.render import render as render_fleet

    with naming_files(out):
        read = fleet_file.load(fleet)
        tell(read, render_fleet(read, Place(out, ca_folder(out, ca)), datetime.now(UTC)), "nothing has changed")


def renew(subject: Subject, fleet: FleetFile = DEFAULT_FLEET, out: Out = DEFAULT_OUT, ca: Ca = None) -> None:
    """Make a new certificate of a name; the one before it stays admitted until the next renewal or revocation."""
    from noctule_deploy import fleet_file
    from noctule_deploy.cli.changes import tell
    from noctule_deploy.render import Place
    from noctule_deploy.render import renew as renew_fleet

    with naming_files(out):
        read = fleet_file.load(fleet)
        tell(read, renew_fleet(read, Place(out, ca_folder(out, ca)), subject, datetime.now(UTC)))


def revoke(subject: Subject, fleet: FleetFile = DEFAULT_FLEET, out: Out = DEFAULT_OUT, ca: Ca = None) -> None:
    """Admit none of the certificates that a name has had, and make it a new one."""
    from noctule_deploy import fleet_file
    from noctule_deploy.cli.changes import tell
    from noctule_deploy.render import Place
    from noctule_deploy.render import revoke as revoke_fleet

    with naming_files(out):
        read = fleet_file.load(fleet)
        tell(read, revoke_fleet(read, Place(out, ca_folder(out, ca)), subject, datetime.now(UTC)))
