"""Files that are written whole or not at all: each beside its place first, then put there in one step."""

import contextlib
import os
import shutil
from collections.abc import Mapping
from pathlib import Path


def write_whole(contents: Mapping[Path, bytes]) -> None:
    """Write files, the old of each staying until all the new ones are on the disk; a device is written directly.
    Raises OSError that names the file, with nothing left behind, where one can't be written.
    """
    beside = {path.resolve(): _beside(path.resolve()) for path in contents if not is_device(path)}
    try:
        for path, content in contents.items():
            try:
                if is_device(path):
                    path.write_bytes(content)
                else:
                    _write(beside[path.resolve()], content)
            except OSError as error:
                error.filename = str(path)  # none for a full disk, and else the name of the file beside it
                raise
        for path, new in beside.items():
            if path.exists():
                shutil.copymode(path, new)
            new.replace(path)
    finally:
        for new in beside.values():
            with contextlib.suppress(OSError):
                new.unlink(missing_ok=True)


def is_device(path: Path) -> bool:
    """Whether something is there that can't be replaced by a file, such as /dev/stdout or a pipe."""
    return path.exists() and not path.is_file()


def _beside(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.new")


def _write(path: Path, content: bytes) -> None:
    with path.open("xb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())
