"""What tests let the viewer hear: statuses of a mapper and of units."""

from noctule.messages_pb2 import ServiceStatus, UnitStatus
from noctule_viewer.board import documents
from noctule_viewer.board.site_state import SiteState
from noctule_viewer.board.unit_health import UnitHealth, UnitsHealth

BEGAN_S = 1_800_000_000.0


class Site:
    """A site as the viewer hears it, at a time that a test sets."""

    def __init__(self) -> None:
        self.passed_s = 0.0
        self.state = SiteState(lambda: 50.0 + self.passed_s, lambda: BEGAN_S + self.passed_s)
        self.state.note_own_trouble("")
        self._health = UnitsHealth()

    def mapper(self, detail: str = "") -> None:
        self.state.note_service(ServiceStatus(name="mapper", role="mapper", detail=detail))

    def unit(
        self, unit: str, state: "UnitStatus.State" = UnitStatus.STATE_SWEEPING, detail: str = "", log_head: int = 0
    ) -> None:
        self.state.note_alive(unit, True)
        status = UnitStatus(unit=unit, gateway="g1", state=state, detail=detail, log_head=log_head)
        status.since.FromNanoseconds(round((BEGAN_S - 3_600) * 1e9))
        self.state.note_unit(status)

    def units(self) -> list[UnitHealth]:
        return self._health.of(self.state.heard())

    def alarms(self) -> str:
        return documents.alarms("attic", self.units(), self.state.heard())
