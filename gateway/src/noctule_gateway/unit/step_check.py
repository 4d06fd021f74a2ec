"""What a unit's own check of its bearings says: it finds home again every few sweeps, and corrects what has slipped."""

from math import degrees

from noctule.bounds import MOST_SUSPECT
from noctule.messages_pb2 import FAULT_KIND_SLIPPED, Sweep, UnitFault
from noctule_gateway.clock.regression import TICKS_TO_WRAP
from noctule_gateway.health.vocabulary import FAULTS
from noctule_gateway.wire.frames import NO_SLIP, AnySweep, Mechanics, Status
from noctule_gateway.wire.sweep_message import bearing_rad

_SURE = 0.99
_TOLERATED = 55  # 1/65536 turn: three half steps are no slip, four are, by any gear that a unit takes


class StepCheck:
    """The checks of the unit ``unit`` of ``site``, as its sweeps and its MECHANICS tell of them."""

    def __init__(self, site: str, unit: str) -> None:
        self._address = f"{site} {unit}"
        self._slip_deg: float | None = None  # at the latest check, if that found a slip
        self._first_slip_deg: float | None = None  # of the fault that stands: its words are to stay the same
        self._since: tuple[int, str] | None = None  # start of the first sweep that says so (ns), and its clock's epoch
        self._right: tuple[int, int] | None = None  # when the unit last said that all is right: boot and tick

    def checked(self, mechanics: Mechanics) -> None:
        """The unit has told by how much its bearings were off."""
        known = mechanics.slip != NO_SLIP and abs(mechanics.slip) > _TOLERATED
        self._slip_deg = degrees(bearing_rad(mechanics.slip)) if known else None
        if self._since is not None and self._first_slip_deg is None:
            self._first_slip_deg = self._slip_deg

    def said(self, boot: int, status: Status) -> None:
        """The unit, under ``boot`` (a boot_of_life), has told whether its latest check found a slip."""
        if status.slipped:
            self._right = None
        else:
            self._right, self._since = (boot, status.tick), None

    def mark(self, sweep: Sweep, told: AnySweep) -> bool:
        """Write what ``told`` says into ``sweep``, and whether that alone flags it.

        After a slip the motor may slip again, until a check finds none.
        """
        sweep.suspect_before = max(sweep.suspect_before, min(told.suspect_before, MOST_SUSPECT))
        if not told.slipped:
            self._since = None
            return False
        if self._since is None and not self._is_over(told):
            self._since, self._first_slip_deg = (sweep.start.ToNanoseconds(), sweep.clock_epoch), self._slip_deg
        alone = not sweep.faults
        if FAULT_KIND_SLIPPED not in sweep.faults:
            sweep.faults.append(FAULT_KIND_SLIPPED)
        return alone

    def added_to(self, found: list[UnitFault], clock_epoch: str) -> list[UnitFault]:
        """The faults that its sweeps show, and what its check has found before them: that is measured."""
        if self._since is None:
            return found
        return [self._fault(*self._since, clock_epoch), *(one for one in found if one.kind != FAULT_KIND_SLIPPED)]

    def _is_over(self, told: AnySweep) -> bool:
        """Since this sweep was made a check has found the bearings right: it comes late, after an outage."""
        if self._right is None:
            return False
        boot, tick = self._right
        return told.boot_of_life != boot or (tick - told.start) % TICKS_TO_WRAP < TICKS_TO_WRAP // 2

    def _fault(self, since_ns: int, epoch: str, clock_epoch: str) -> UnitFault:
        amount = "" if self._first_slip_deg is None else f" by {self._first_slip_deg:+.1f} degrees"
        fault = UnitFault(
            kind=FAULT_KIND_SLIPPED,
            confidence=_SURE,
            words=f"its home switch showed that its bearings were off{amount}; it has corrected them",
            advice=FAULTS[FAULT_KIND_SLIPPED].advice.replace("SITE UNIT", self._address),
        )
        if epoch == clock_epoch:
            fault.since.FromNanoseconds(since_ns)
        return fault
