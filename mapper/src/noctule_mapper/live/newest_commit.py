"""The small file beside the store that knows its newest commit, as the gateway's head files do.

SQLite reads a -wal up to the first damaged frame and says nothing of the commits behind it. Contours would get numbers
for a second time; and where some of these commits had been copied into the database already, old pages of the -wal
stand over newer ones. So such a store counts as damaged.

The file is written after each commit and before anybody hears of it, without waiting for the disk: it outlives the
mapper, and not always a power cut. After another boot of the kernel it tells no more than the contours' numbers.
"""

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

from noctule.checksum import checksum

_BYTES = 256  # padded to this, so that it is written over in place, also on a full disk


@dataclass(frozen=True)
class Newest:
    """The count of elapsed seconds at the newest commit, the number up to which contours may be numbered, and the id of
    the kernel's boot.
    """

    elapsed_s: float
    contours: int
    kernel_boot: str


def beside(store: Path) -> Path:
    """The file that belongs to a store."""
    return store.with_name(f"{store.name}.newest")


def read(store: Path) -> Newest | None:
    """What is known of the newest commit of ``store``; None where the file is missing or damaged. Raises OSError."""
    try:
        values = json.loads(beside(store).read_bytes())
        found = values.pop("checksum")
        return Newest(**values) if checksum(*values.values()).hex() == found else None
    except (FileNotFoundError, ValueError, TypeError, KeyError, AttributeError):
        return None


class NewestCommit:
    """The file of an open store."""

    def __init__(self, store: Path) -> None:
        self._path = beside(store)
        self._file: int | None = None
        self._noted: Newest | None = None

    def note(self, newest: Newest) -> None:
        """This is the newest commit. Raises OSError."""
        if newest == self._noted:  # nothing but reading was done
            return
        if self._file is None:
            self._file = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o644)
        values = asdict(newest)
        text = json.dumps(values | {"checksum": checksum(*values.values()).hex()})
        os.pwrite(self._file, text.encode().ljust(_BYTES - 1) + b"\n", 0)
        self._noted = newest

    def close(self) -> None:
        if self._file is not None:
            os.close(self._file)
