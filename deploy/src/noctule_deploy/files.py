"""Files that are either whole or as they were."""

import os
import tempfile
from pathlib import Path

from noctule_deploy.errors import RenderError


def make_private_folder(folder: Path) -> None:
    """A folder that only its owner can look into. Raises RenderError."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise RenderError(f"the folder {folder} can't be made: {error.strerror}") from error


def write_new_key(path: Path, content: bytes) -> None:
    """A private key in a new file that only its owner can read. Raises FileExistsError."""
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def write_atomically(path: Path, content: bytes, mode: int = 0o644) -> bool:
    """Give a file this content; False where it has it already, and then nothing is written. Raises RenderError."""
    if path.is_file() and path.read_bytes() == content:
        return False
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", delete=False) as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(file.name).chmod(mode)
        Path(file.name).replace(path)
    except OSError as error:
        raise RenderError(f"{path} can't be written: {error.strerror}") from error
    return True
