"""The command noctule-mapper; a module here for each command. One that fails says why in one line.

A command loads what it works with when it is called, in its own function, so that no help and no other command waits
for that.
"""

import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from noctule.program_options import Commands, version_option
from noctule_mapper.cli.calibrate import calibrate
from noctule_mapper.cli.export import export
from noctule_mapper.cli.fit import fit
from noctule_mapper.cli.reproduce import reproduce
from noctule_mapper.cli.run import run
from noctule_mapper.cli.share import share
from noctule_mapper.cli.store import backup, check, repair
from noctule_mapper.cli.survey import survey

app = typer.Typer(cls=Commands, no_args_is_help=True, pretty_exceptions_enable=False)
for _command in (run, share, fit, calibrate, survey, export, reproduce, repair, check, backup):
    app.command()(_command)


@app.callback()
def _noctule_mapper(_version: Annotated[bool, version_option("noctule-mapper")] = False) -> None:
    """Sweeps to contours."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line, or ``arguments``; tell in one line what went wrong. Raises SystemExit with the status."""
    try:
        app(arguments)
    except Exception as error:
        from noctule.errors import NoctuleError, SiteFileError, in_words

        if isinstance(error, SiteFileError):
            sys.exit(str(error))  # a line for each mistake, which begins with the file
        if not isinstance(error, NoctuleError | OSError):
            raise
        sys.exit(f"noctule-mapper: {in_words(error)}")
