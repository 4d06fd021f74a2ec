"""The command ``noctule-gateway``; a module here for each command.

A command loads what it works with when it is called, in its own function, so that no help and no other command waits
for that.
"""

from typing import Annotated, NoReturn

import typer

from noctule.ending import end_with
from noctule.program_options import version_option
from noctule_gateway.cli.data import backup, check, repair
from noctule_gateway.cli.router import router
from noctule_gateway.cli.run import run
from noctule_gateway.cli.update import update

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False)


@app.callback()
def main(_version: Annotated[bool, version_option("noctule-gateway")] = False) -> None:
    """Serial scanner units to Zenoh."""


for _command in (run, router, update, repair, check, backup):
    app.command()(_command)


def program() -> NoReturn:
    """The whole process."""
    end_with(app)
