"""The demo's data folder: it begins empty each time, and nothing is deleted that the demo did not make."""

import fcntl
import shutil
from pathlib import Path
from typing import TextIO

MARKER = ".noctule-demo"
MARKER_TEXT = "Noctule's demo made this folder. At its next start it deletes site.toml, gateway and mapper in it.\n"
_MADE = {MARKER, "site.toml", "gateway", "mapper"}
_NAMED = 3


class FolderError(Exception):
    """The folder can't be the demo's; nothing in it was changed."""


def check(folder: Path) -> None:
    """Raises FolderError if the folder holds anything that is not the demo's."""
    if not folder.exists() and not folder.is_symlink():
        return
    if not folder.is_dir():
        raise FolderError(f"{folder} is not a folder: choose another with DEMO_DATA=...")
    held = {entry.name for entry in folder.iterdir()}
    foreign = sorted(held - _MADE if _is_the_demos(folder) else held)
    if foreign:
        more = f" and {len(foreign) - _NAMED} more" if len(foreign) > _NAMED else ""
        raise FolderError(
            f"{folder} holds what the demo did not make ({', '.join(foreign[:_NAMED])}{more}); nothing was changed: "
            "choose another folder with DEMO_DATA=..."
        )


def begin(folder: Path, site_file: str) -> TextIO:
    """Clear what an earlier demo made and write the site file.

    The marker that is returned is locked: while it is open, no other demo can begin here. Raises FolderError.
    """
    check(folder)
    folder.mkdir(parents=True, exist_ok=True)
    marker = (folder / MARKER).open("a")
    try:
        fcntl.flock(marker, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise FolderError(f"another demo runs in {folder}: end it, or choose another with DEMO_DATA=...") from None
    marker.truncate(0)
    marker.write(MARKER_TEXT)
    marker.flush()
    for name in _MADE - {MARKER}:
        _delete(folder / name)
    (folder / "site.toml").write_text(site_file)
    return marker


def _is_the_demos(folder: Path) -> bool:
    marker = folder / MARKER
    return marker.is_file() and not marker.is_symlink()


def _delete(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)  # of a symlink only the link
