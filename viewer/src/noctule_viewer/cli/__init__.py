"""The command noctule-viewer: ``run`` is the relay between mappers and those who watch, ``open`` shows the map.

A command loads what it works with when it is called, in its own function, so that no help and no other command waits
for that.
"""

from typing import Annotated

import typer

from noctule.program_options import Commands, version_option
from noctule_viewer.cli.recordings import days, open_
from noctule_viewer.cli.run import run

app = typer.Typer(cls=Commands, no_args_is_help=True, pretty_exceptions_enable=False)


@app.callback()
def main(_version: Annotated[bool, version_option("noctule-viewer")] = False) -> None:
    """The Rerun relay and the layout of the viewer."""


app.command()(run)
app.command("open")(open_)
app.command()(days)
