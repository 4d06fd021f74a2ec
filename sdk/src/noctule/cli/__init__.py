"""The command `noctule`: look at a site, record and replay it, ask its units. Needs the extra noctule[cli]."""

import logging
import signal
import sys
from typing import Annotated, NoReturn

try:
    import typer
except ModuleNotFoundError as error:
    raise SystemExit("the command noctule needs typer, rich and mcap: install noctule[cli]") from error

from noctule import threads
from noctule.cli import ask, command, doctor, import_scan, record, replay, show, unit_report, update
from noctule.errors import NoctuleError, SiteFileError, in_words
from noctule.logs import StderrHandler, TextFormatter
from noctule.plain_text import plain
from noctule.program_options import Commands, version_option

commands = typer.Typer(cls=Commands, no_args_is_help=True, pretty_exceptions_enable=False)
for each in (show.units, show.watch, record.record, replay.replay, ask.log, ask.schema, doctor.doctor, update.update):
    commands.command()(each)
commands.command("unit-report")(unit_report.unit_report)
commands.command("import")(import_scan.import_)
commands.add_typer(command.rpc, name="rpc")


@commands.callback()
def _noctule(_version: Annotated[bool, version_option("noctule")] = False) -> None:
    """Look at a Noctule site, record and replay it, ask its units."""


def app() -> None:
    """Run the command line; what went wrong stands in one line, a site file's mistakes in a line each."""
    handler = StderrHandler()
    handler.setFormatter(TextFormatter("%(levelname)s %(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    threads.end_process_when_one_fails()
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        commands()
    except SiteFileError as error:
        sys.exit("\n".join(map(plain, str(error).splitlines())))  # each begins with the file
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output has left, and so do we; nothing is left to flush to
    except (NoctuleError, OSError) as error:
        sys.exit(f"noctule: {plain(in_words(error))}")


def _interrupt(_signal: int, _frame: object) -> NoReturn:
    raise KeyboardInterrupt
