"""The command ``noctule-gateway``; a module here for each command.

A command loads what it works with when it is called, in its own function, so that no help and no other command waits
for that.
"""

from typing import Annotated

import typer

from noctule.program_options import Commands, version_option
from noctule_gateway.cli.data import backup, check, repair
from noctule_gateway.cli.router import router
from noctule_gateway.cli.run import run
from noctule_gateway.cli.update import update

app = typer.Typer(cls=Commands, no_args_is_help=True, pretty_exceptions_enable=False)


@app.callback()
def main(_version: Annotated[bool, version_option("noctule-gateway")] = False) -> None:
    """Serial scanner units to Zenoh."""


for _command in (run, router, update, repair, check, backup):
    app.command()(_command)
