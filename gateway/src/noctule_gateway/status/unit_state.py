"""What is known of a unit at one moment: the latest of what it has said of itself, and how it is served."""

from dataclasses import dataclass, field, replace

from noctule.messages_pb2 import UnitFault
from noctule_gateway.log.sweep_log import LogState
from noctule_gateway.wire.frames import Hello, Loader, Mechanics, Status


@dataclass(frozen=True)
class UnitState:
    """A value: each of its methods gives the state that follows."""

    trouble: str = "not connected yet"  # why the unit does not answer; empty while it does
    update: str = ""  # how far an update is, while there is one
    hello: Hello | None = None  # the latest
    loader: Loader | None = None  # while the unit sits there
    status: Status | None = None  # the latest
    mechanics: Mechanics | None = None  # the latest of this boot
    lines_opened: int = 0
    log: LogState = field(default_factory=LogState)
    setup_error: str = ""  # the standing order that the unit refused
    lost_pose: bool = False  # the last sweep had none
    late: bool = False  # the unit is served later than it should be
    bad_line: bool = False  # much of what the unit sends can't be read
    out_of_turn: str = ""  # why it pings as it likes though others may hear it
    faults: tuple[UnitFault, ...] = ()  # what its sweeps show

    def line_opened(self) -> "UnitState":
        """The line to the unit is open."""
        return replace(self, lines_opened=self.lines_opened + 1)

    def identified(self, hello: Hello) -> "UnitState":
        """The unit has said who it is."""
        kept = self.mechanics if self.hello and self.hello.boot_of_life == hello.boot_of_life else None
        return replace(self, hello=hello, loader=None, trouble="", mechanics=kept)

    def lost(self, why: str, loader: Loader | None = None) -> "UnitState":
        """The unit can't be asked for anything, maybe because it is in its ``loader``."""
        return replace(self, trouble=why, loader=loader)

    def said(self, status: Status) -> "UnitState":
        """The unit has told its status."""
        return replace(self, status=status)

    def measured(self, mechanics: Mechanics) -> "UnitState":
        """The unit has told what it has found out about its motor and gears."""
        return replace(self, mechanics=mechanics)

    def updating(self, progress: str) -> "UnitState":
        """An update has got as far as ``progress`` says; empty when it is over."""
        return replace(self, update=progress)
