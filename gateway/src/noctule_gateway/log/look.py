"""What a unit's log holds, every record of it checked: for the operator, by hand. It changes nothing."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from noctule.messages_pb2 import Sweep
from noctule.sqlite_faults import SQLITE_ERRORS
from noctule_gateway.errors import LogError
from noctule_gateway.log.log_files import SUFFIX
from noctule_gateway.log.log_reader import uncovered
from noctule_gateway.log.salvage import Salvage

_MOST_NAMED = 20  # damaged sweeps of one log


@dataclass(frozen=True)
class Look:
    """What was found. ``stated``: sweeps that the log itself says it has lost; ``trouble``: how it is damaged, empty if
    it is not; ``strangers``: other units whose sweeps it holds, as where the files of two units were exchanged.
    """

    unit: str
    sweeps: int = 0
    tail: int = 0
    head: int = 0
    stated: int = 0
    trouble: str = ""
    strangers: tuple[str, ...] = ()

    @property
    def is_sound(self) -> bool:
        """All records can be read, and all are the unit's."""
        return not self.trouble and not self.strangers

    def __str__(self) -> str:
        bounds = f"{self.tail} to {self.head}" if self.head >= self.tail else "none"
        lost = f", {self.stated} lost to damage before" if self.stated else ""
        strangers = f"it holds sweeps of {', '.join(self.strangers)}" if self.strangers else ""
        found = "; ".join(filter(None, (self.trouble, strangers))) or "all is sound"
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
        with closing(Salvage(path)) as found:
            return _look_at(path.stem, found)
    except SQLITE_ERRORS as error:
        return Look(path.stem, trouble=f"the file is damaged: {error}")


def _look_at(unit: str, file: Salvage) -> Look:
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
    return Look(unit, len(sound), tail, head, stated, trouble, tuple(sorted(strangers)))


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
