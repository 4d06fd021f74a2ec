"""What a check has found."""

from dataclasses import dataclass
from enum import Enum


class Level(Enum):
    """How bad a finding is."""

    OK = "ok"
    WARNING = "warning"
    FAULT = "fault"


@dataclass(frozen=True)
class Finding:
    """One line for the operator: ``about`` names the subject, ``text`` says what was found, and what to do."""

    level: Level
    about: str
    text: str


def exit_status(findings: list[Finding]) -> int:
    """0: all is well; 1: a fault; 3: warnings only."""
    levels = {finding.level for finding in findings}
    return 1 if Level.FAULT in levels else 3 if Level.WARNING in levels else 0
