"""The kinds of bounds: each says in words what is wrong with a value."""

from dataclasses import dataclass

from noctule import keys
from noctule.errors import KeyFormatError

_SHOWN = 60  # characters of a refused text


@dataclass(frozen=True)
class Number:
    """A number from ``least`` to ``most``, and finite; ``meant`` is what its writer may have got wrong."""

    least: float
    most: float
    unit: str = ""
    meant: str = ""

    def fault(self, value: float) -> str:
        """What is wrong with ``value``; empty if nothing is."""
        if self.least <= value <= self.most:  # False for NaN
            return ""
        return f"is {_shown(value)}: {self.allowed()}"

    def allowed(self, per_unit: float = 1, unit: str | None = None) -> str:
        """The interval in words, in this unit or in another, of which this one holds ``per_unit``."""
        interval = f"{_shown(self.least * per_unit)} to {_shown(self.most * per_unit)}"
        words = f"give {interval} {self.unit if unit is None else unit}".rstrip()
        return f"{words} ({self.meant})" if self.meant else words


@dataclass(frozen=True)
class Text:
    """Text of up to ``longest`` characters."""

    longest: int

    def fault(self, value: str) -> str:
        """What is wrong with ``value``; empty if nothing is."""
        if len(value) <= self.longest:
            return ""
        return f"is {value[:_SHOWN]!r}...: {len(value)} characters, and {self.longest} are allowed"


@dataclass(frozen=True)
class Name:
    """A name that can be part of a key, or empty where nobody set it."""

    def fault(self, value: str) -> str:
        """What is wrong with ``value``; empty if nothing is."""
        try:
            if value:
                keys.name(value, "the name")
        except KeyFormatError as error:
            return f"is wrong: {error}"
        return ""


@dataclass(frozen=True)
class Data:
    """Up to ``longest`` bytes."""

    longest: int

    def fault(self, value: bytes) -> str:
        """What is wrong with ``value``; empty if nothing is."""
        return "" if len(value) <= self.longest else f"has {len(value)} bytes, and {self.longest} are allowed"


@dataclass(frozen=True)
class Many:
    """Up to ``most`` elements: messages, or what ``each`` allows."""

    most: int
    each: Number | None = None


@dataclass(frozen=True)
class Counts:
    """A map of up to ``most`` names to numbers."""

    most: int
    name: Text
    each: Number


Bound = Number | Text | Name | Data | Many | Counts


def _shown(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:.6g}"
