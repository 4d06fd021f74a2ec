"""What a unit's log holds, every record of it checked: for the operator, by hand. It changes nothing."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from noctule.messages_pb2 import Sweep
from noctule.sqlite_faults import SQLITE_ERRORS
from noctule_gateway.errors import LogError
from noctule_gateway.log import head_file
from noctule_gateway.log.head_file import Heads
from noctule_gateway.log.log_files import SUFFIX, head_path
from noctule_gateway.log.log_reader import uncovered
from noctule_gateway.log.salvage import Salvage

_MOST_NAMED = 20  # damaged sweeps of one log


@dataclass(frozen=True)
class Look:
    """What was found. ``stated``: sweeps that the log itself says it has lost; ``trouble``: how it is damaged, empty if
    it is not; ``strangers``: other units whose sweeps it holds, as where the files of two units were exchanged;
    ``committed``: the newest sweep that its head file knows of, 0 where it knows none of this log.
    """

    unit: str
    sweeps: int = 0
    tail: int = 0
    head: int = 0
    stated: int = 0
    trouble: str = ""
    strangers: tuple[str, ...] = ()
    committed: int = 0

    @property
    def is_sound(self) -> bool:
        """All records can be read, all are the unit's, and the newest are there."""
        return not self.trouble and not self.strangers and self.committed <= self.head

    def __str__(self) -> str:
        bounds = f"{self.tail} to {self.head}" if self.head >= self.tail else "none"
        lost = f", {self.stated} lost to damage before" if self.stated else ""
        strangers = f"it holds sweeps of {', '.join(self.strangers)}" if self.strangers else ""
        gone = f"its newest commits, up to sweep {self.committed}, are gone" if self.committed > self.head else ""
        found = "; ".join(filter(None, (self.trouble, strangers, gone))) or "all is sound"
        return f"{self.unit}: {self.sweeps} sound sweeps, sequences {bounds}{lost}; {found}"


def look_at_all(data: Path, tell: Callable[[str, int, int], None] = lambda *_: None) -> list[Look]:
    """Look at every log in the folder ``data``, also while a gateway runs. Raises LogError where there is none.

    ``tell`` is given what is read, how many are done, and of how many.
    """
    units = units_in(data)
    if not units:
        if data.is_file():
            raise LogError(f"{data} is no folder of logs: for a site file type noctule doctor {data}")
        raise LogError(f"{data} holds no logs: give what noctule-gateway run has as --data")
    looks = []
    for done, unit in enumerate(units):
        tell(f"Reading the log of {unit}", done, len(units))
        looks.append(look_at(data / f"{unit}{SUFFIX}"))
    return looks


def units_in(data: Path) -> list[str]:
    """The units of whose logs there is any file in the folder ``data``."""
    return sorted({path.name.partition(SUFFIX)[0] for path in data.glob(f"*{SUFFIX}*")})


def look_at(path: Path) -> Look:
    """Read the whole log at ``path``. Raises LogError where it is of a later gateway."""
    try:
        heads = head_file.read(head_path(path), head_file.file_identity(path))  # first: a gateway may go on meanwhile
        with closing(Salvage(path)) as found:
            return _look_at(path.stem, found, heads)
    except SQLITE_ERRORS as error:
        return Look(path.stem, trouble=f"the file is damaged: {error}")


def _look_at(unit: str, file: Salvage, heads: Heads) -> Look:
    sound: list[int] = []
    bad: list[str] = []
    strangers: set[str] = set()
    for found in file.sweeps():
        if found.row is None:
            bad.append(f"{found.log_sequence}: {found.reason}")
        else:
            sound.append(found.log_sequence)
            strangers |= {Sweep.FromString(found.row[7]).unit} - {unit}
    log = file.log
    head, tail = (log.head, log.tail) if log else (max(sound, default=0), min(sound, default=1))
    stated = sum(gap.sequences(gap.first, gap.last) for gap in file.gaps if gap.damaged)
    trouble = _trouble(file, bad, _missing(file, tail, head, sound, len(bad)))
    newest = None if heads.copied else heads.newest
    committed = newest.head if newest and log and newest.log_id == log.log_id else 0
    return Look(unit, len(sound), tail, head, stated, trouble, tuple(sorted(strangers)), committed)


def _missing(file: Salvage, tail: int, head: int, sound: Sequence[int], bad: int) -> int:
    """How many sweeps there should be that nothing at all is left of."""
    return max(uncovered(file.gaps, tail, head) - len(sound) - bad, 0)


def _trouble(file: Salvage, bad: Sequence[str], missing: int) -> str:
    more = f", and {len(bad) - _MOST_NAMED} more" if len(bad) > _MOST_NAMED else ""
    troubles = [
        "its tables are not a log's" if file.strange else "",
        "its table log does not fit" if file.log is None else "",
        f"{len(bad)} more records can't be read (sweep {'; '.join(bad[:_MOST_NAMED])}{more})" if bad else "",
        f"{missing} sweeps are missing" if missing else "",
        file.integrity(),
    ]
    found = "; ".join(filter(None, troubles))
    return f"the file is damaged: {found}" if found else ""
