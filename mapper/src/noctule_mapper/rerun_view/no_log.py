"""Where nobody is to watch: what a RerunLog has, without Rerun, whose import takes half a second of the processor."""

from collections.abc import Iterable

from noctule.messages_pb2 import Contour, Features, GridTile, ServiceStatus, UnitStatus
from noctule_mapper.readings.sweep import SweepReadings


class NoLog:
    """Shows nothing to nobody."""

    def recall_sweep(self, readings: SweepReadings) -> None:
        pass

    def show_sweep(self, readings: SweepReadings) -> None:
        pass

    def show_contour(self, contour: Contour) -> None:
        pass

    def show_features(self, features: Features) -> None:
        pass

    def show_tiles(self, tiles: Iterable[GridTile]) -> None:
        pass

    def show_unit_status(self, status: UnitStatus) -> None:
        pass

    def show_service_status(self, status: ServiceStatus, summary: str) -> None:
        pass

    def show_event(self, text: str, level: str = "INFO") -> None:
        pass

    def counters(self) -> dict[str, int]:
        return {}

    def close(self) -> None:
        pass
