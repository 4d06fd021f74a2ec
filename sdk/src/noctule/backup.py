"""Copies of the SQLite files of a data folder, taken while a program writes them."""

import shutil
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from noctule.errors import NoctuleError
from noctule.sqlite_faults import SQLITE_ERRORS


class BackupError(NoctuleError):
    """A data folder could not be copied."""


@contextmanager
def whole_or_nothing(out: Path) -> Iterator[None]:
    """Within the block a backup is made in ``out``, which is removed if the block fails and it was not there before."""
    was_there = out.exists()
    try:
        yield
    except BaseException:  # Ctrl-C too
        if not was_there:
            shutil.rmtree(out, ignore_errors=True)
        raise


def copy_databases(data: Path, out: Path, tell: Callable[[str, int, int], None]) -> list[Path]:
    """Copy every database ``data/*.sqlite*`` into the new folder ``out``, each one as it is at one moment.

    ``tell`` is given what is copied, how many are done, and of how many. Raises BackupError; what was copied before it
    stays, outside of whole_or_nothing().
    """
    found = sorted(each for each in data.glob("*.sqlite*") if each.suffix in (".sqlite", ".sqlite3"))
    if not found:
        raise BackupError(f"{data} holds no data of a gateway or mapper: give what its run has as --data")
    if out.resolve().is_relative_to(data.resolve()):
        raise BackupError(f"{out} is in {data} itself: give a folder outside of it")
    try:
        out.mkdir(parents=True)
    except FileExistsError as error:
        raise BackupError(f"{out} is there already: give a new folder, so that no backup is overwritten") from error
    except OSError as error:
        raise BackupError(f"{out} can't be made: {error.strerror}") from error
    for done, path in enumerate(found):
        tell(f"Copying {path.name}", done, len(found))
        _copy(path, out / path.name)
    return [out / path.name for path in found]


def _copy(path: Path, copy: Path) -> None:
    try:
        source = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)
        with closing(source), closing(sqlite3.connect(copy)) as target:
            source.backup(target)
    except SQLITE_ERRORS as error:
        raise BackupError(f"{path} can't be copied to {copy}: {error}; see what check says of it") from error
