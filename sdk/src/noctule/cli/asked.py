"""What a command line asks of a unit."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Addressed:
    """The unit that the command line names, and how its reply is to be shown."""

    site: str
    unit: str
    json: bool


@dataclass(frozen=True)
class Asked:
    """A command for that unit, over which routers it goes, and how long its reply may take."""

    of: Addressed
    command: str
    connect: list[str]
    tls: Path | None
    timeout_s: float
