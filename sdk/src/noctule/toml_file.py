"""Reads a TOML file that a person has written: what it says, and on which line."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from noctule.errors import NoctuleError
from noctule.toml_lines import Place, lines


@dataclass(frozen=True)
class TomlFile:
    """The ``entries`` of a file, and by place the line of each table's header and each key (see ``toml_lines``)."""

    entries: dict[str, Any]
    lines: Mapping[Place, int]


def read(path: Path, error: type[NoctuleError], if_absent: str = "") -> TomlFile:
    """Raises ``error`` with the file's name where it can't be read or is not TOML.

    ``if_absent`` says what to do where there is no such file.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")  # some editors begin with a byte order mark
        return TomlFile(tomllib.loads(text), lines(text))
    except OSError as cause:
        if if_absent and isinstance(cause, FileNotFoundError):
            raise error(f"{path} is not there: {if_absent}") from cause
        raise error(f"{path} can't be read: {cause.strerror}") from cause
    except (ValueError, RecursionError) as cause:  # not TOML, or not text, or 1,000 brackets deep
        raise error(f"{path} is not a TOML file: {cause}") from cause
