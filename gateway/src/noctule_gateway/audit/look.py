"""Whether the audit logs are what was written, every line of them: for the operator, by hand. It changes nothing."""

from dataclasses import dataclass
from pathlib import Path

from noctule_gateway.audit import lines
from noctule_gateway.audit.allowance import COMMANDS, REFUSALS
from noctule_gateway.errors import AuditError

_MOST_NAMED = 20  # damaged places
_NAMES = {keeping.family: keeping.name for keeping in (COMMANDS, REFUSALS)}


@dataclass(frozen=True)
class AuditLook:
    """What was found in the log ``family``: ``sound`` lines, numbered ``first`` to ``last``.

    ``trouble`` is empty if nothing was altered.
    """

    family: str
    sound: int
    first: int
    last: int
    cut: int  # files whose last line a crash has cut
    trouble: str

    @property
    def is_sound(self) -> bool:
        """Nothing was altered."""
        return not self.trouble

    def __str__(self) -> str:
        numbers = f"{self.first} to {self.last}" if self.sound else "none"
        cut = f", {self.cut} unfinished at the end of a file, as a crash leaves them" if self.cut else ""
        state = self.trouble or "all is sound"
        return f"{_NAMES[self.family]}: {self.sound} sound lines, numbers {numbers}{cut}; {state}"


def look_at_audit(data: Path) -> list[AuditLook]:
    """Look at the audit logs in the folder ``data``, also while a gateway runs; nothing where there is none."""
    return [_look(family, found) for family in _NAMES if (found := lines.files(data, family))]


def _look(family: str, found: list[tuple[int, Path]]) -> AuditLook:
    chain = _Chain(family)
    for number, path in found:
        chain.take_file(number, path)
    more = f"; and {len(chain.bad) - _MOST_NAMED} more" if len(chain.bad) > _MOST_NAMED else ""
    trouble = f"it was altered: {'; '.join(chain.bad[:_MOST_NAMED])}{more}" if chain.bad else ""
    return AuditLook(family, len(chain.numbers), min(chain.numbers, default=0), chain.last or 0, chain.cut, trouble)


def copy_audit(data: Path, out: Path) -> None:
    """Copy the audit logs of the folder ``data`` into ``out``, up to the last line that is whole. Raises AuditError."""
    for _, path in (each for family in _NAMES for each in lines.files(data, family)):
        try:
            content = path.read_bytes()
            (out / path.name).write_bytes(content[: content.rfind(b"\n") + 1])
        except OSError as error:
            raise AuditError(f"{path} can't be copied to {out}: {error.strerror}") from error


class _Chain:
    """The lines of all files, in their order; ``hash`` and ``last`` are those of the last sound line."""

    def __init__(self, family: str) -> None:
        self._family = family
        self.numbers: list[int] = []
        self.bad: list[str] = []
        self.cut = 0
        self.hash: str | None = None
        self.last: int | None = None
        self._file: int | None = None

    def take_file(self, number: int, path: Path) -> None:
        """Read one file and hold it against what came before."""
        if self._file is not None and number != self._file + 1:
            self.bad.append(self._missing(self._file + 1, number - 1))
            self.hash = self.last = None
        self._file = number
        try:
            content = path.read_bytes()
        except OSError as error:
            self.bad.append(f"{path.name} can't be read: {error.strerror}")
            self.hash = self.last = None
            return
        *whole, rest = content.split(b"\n")
        self.cut += bool(rest) or not content  # a power cut leaves these two
        begins = True
        for place, line in enumerate(whole, start=1):
            self._take_line(f"{path.name}, line {place}", line, begins)
            begins = False

    def _take_line(self, where: str, line: bytes, begins: bool) -> None:
        try:
            facts, own = lines.read(line, None if begins else self.hash or "")
        except AuditError as error:
            self.bad.append(f"{where} {error}")
            self._go_on_from(line)
            return
        if begins and self.hash is not None and facts.get("after") != self.hash:
            self.bad.append(f"{where} does not go on from the file before: lines at its end are missing")
        elif self.last is not None and facts["number"] != self.last + 1:
            self.bad.append(f"{where} has number {facts['number']} after {self.last}")
        self.numbers.append(facts["number"])
        self.hash, self.last = own, facts["number"]

    def _go_on_from(self, line: bytes) -> None:
        """One line that was changed is named once: the next one is held against what this one says of itself."""
        claimed = lines.claimed(line)
        self.last, self.hash = claimed if claimed else (None, self.hash)

    def _missing(self, first: int, last: int) -> str:
        if first < last:
            return f"{last + 1 - first} files before {lines.file_name(last + 1, self._family)} are missing"
        return f"{lines.file_name(first, self._family)} is missing"
