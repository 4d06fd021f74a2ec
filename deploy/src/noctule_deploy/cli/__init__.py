"""The command ``noctule-deploy``; a module here for each command, or for those that belong together.

A command loads what it works with when it is called, in its own function, so that no help and no other command waits
for that.
"""

import sys
from typing import Annotated

import typer

from noctule.errors import NoctuleError, in_words
from noctule.program_options import Commands, version_option
from noctule_deploy.cli.certificates import render, renew, revoke
from noctule_deploy.cli.check import check
from noctule_deploy.cli.firmware import firmware_key, firmware_sign
from noctule_deploy.cli.init import init
from noctule_deploy.cli.status import status
from noctule_deploy.errors import FleetFileError

app = typer.Typer(cls=Commands, no_args_is_help=True, pretty_exceptions_enable=False)


def main() -> None:
    """Run the command line; what went wrong stands in one line."""
    try:
        app()
    except FleetFileError as error:
        sys.exit(str(error))  # each of its lines begins with the file
    except (NoctuleError, OSError) as error:
        sys.exit(f"noctule-deploy: {in_words(error)}")


@app.callback()
def _noctule_deploy(_version: Annotated[bool, version_option("noctule-deploy")] = False) -> None:
    """From one file, all that the hosts of a fleet need: certificates, access rules, services, and how they fare."""


for _command in (init, render, renew, revoke, check, status, firmware_key, firmware_sign):
    app.command()(_command)
