"""What the mapper tells the people who watch: each method shows one kind of thing and returns at once."""

import threading
from collections import defaultdict, deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from datetime import UTC, datetime
from time import monotonic, time
from typing import Any

from noctule import bounds, keys, poses, rerun_paths
from noctule.messages_pb2 import Contour, Features, GridTile, ServiceStatus, UnitStatus
from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.rerun_view import map as rerun_map
from noctule_mapper.rerun_view import status as rerun_status
from noctule_mapper.rerun_view.drawing import Drawing, Entries
from noctule_mapper.rerun_view.link import RerunLink
from noctule_mapper.rerun_view.sight import Sight, sight
from noctule_mapper.rerun_view.thinning import Thinning

_TRAIL_POSES = 500


class RerunLog:
    """Shows the map on a Rerun relay through a link that never makes the mapper wait.

    The time of what was measured is the sweep's; the time of what the mapper says of itself and of units is the host's.
    """

    def __init__(self, url: str, site: str, now: Callable[[], float] = monotonic) -> None:
        """``site`` names the recording, so that a restarted mapper goes on with it. Raises RelayAddressError."""
        self._link = RerunLink(url, site, rerun_map.draw_frame)
        self._sequences: dict[str, int] = {}
        self._trails: dict[str, deque[tuple[float, float]]] = defaultdict(lambda: deque(maxlen=_TRAIL_POSES))
        self._here: dict[str, tuple[float, float]] = {}  # where each unit was drawn last
        self._poses: dict[str, tuple[float, float, float]] = {}  # of units whose stated pose is unknown
        self._states: dict[str, int] = {}
        self._troubles: dict[str, str] = {}
        self._tiles: dict[tuple[int, int], GridTile] = {}
        self._drawing_tiles = threading.Lock()  # the mapper's thread draws those that change, the one of the status all
        self._contour = Contour()
        self._seen: Sight | None = None
        self._thinning = Thinning(now)

    def recall_sweep(self, readings: SweepReadings) -> None:
        """Take note of a sweep from before a restart: it has been shown."""
        self._sequences[readings.unit] = readings.identity[1]
        if readings.pose_is_unknown:
            return
        trail, here = self._trails[readings.unit], (readings.x_m, readings.y_m)
        if not trail or trail[-1] != here:
            trail.append(here)

    def show_sweep(self, readings: SweepReadings) -> None:
        """A unit's last sweep, where the unit is and how it came there; nothing while its pose is unknown."""
        self.recall_sweep(readings)
        if readings.pose_is_unknown:
            if readings.unit not in self._poses:
                return
            x_m, y_m, heading_rad = self._poses[readings.unit]
            readings = replace(readings, x_m=x_m, y_m=y_m, heading_rad=heading_rad)
        trail_m = tuple(self._trails[readings.unit])
        self._show(rerun_paths.unit_rays(readings.unit), readings.time_s, rerun_map.draw_sweep, readings, trail_m)
        here = readings.x_m, readings.y_m
        if self._here.get(readings.unit) != here:
            self._here[readings.unit] = here
            self._label(readings.time_s)

    def show_contour(self, contour: Contour) -> None:
        """Walls, corners, cylinders and the units' poses."""
        self._poses = {
            pose.unit: (pose.x_m, pose.y_m, pose.heading_rad) for pose in contour.poses if poses.is_placed(pose)
        }
        self._show("contour", _seconds(contour), rerun_map.draw_contour, contour)
        self._contour = contour
        self._label(_seconds(contour))

    def show_features(self, features: Features) -> None:
        """Feature points by kind."""
        self._show(rerun_paths.FEATURES, _seconds(features), rerun_map.draw_features, features)

    def show_tiles(self, tiles: Iterable[GridTile]) -> None:
        """Those tiles of the reliability grid that have changed."""
        for tile in tiles:
            with self._drawing_tiles:
                self._tiles[tile.tile_x, tile.tile_y] = tile
                self._show_tile(tile)
                if not any(tile.occupied) and not any(tile.free):
                    del self._tiles[tile.tile_x, tile.tile_y]

    def show_unit_status(self, status: UnitStatus) -> None:
        """A unit's state and clock, and in the log what it tells its operator; of the first MAX_UNITS units."""
        if status.unit not in self._states and len(self._states) >= bounds.MAX_UNITS:  # somebody makes up names
            return
        now_s = time()
        clock = rerun_paths.unit_clock_error(status.unit)
        if status.state != UnitStatus.STATE_DISCONNECTED and self._thinning.is_due(clock):
            self._show(None, now_s, rerun_status.draw_clock, status)
        if self._states.get(status.unit) != status.state:
            self._states[status.unit] = status.state
            self._show(rerun_paths.unit_state(status.unit), now_s, rerun_status.draw_state, status)
        trouble = rerun_status.trouble(status)
        if self._troubles.get(status.unit, "") != trouble:
            self._troubles[status.unit] = trouble
            text, level = (trouble, "WARN") if trouble else (f"{status.unit} is well again", "INFO")
            self._show(None, now_s, rerun_status.draw_event, rerun_paths.unit_log(status.unit), text, level)

    def show_service_status(self, status: ServiceStatus, summary: str) -> None:
        """The mapper's own figures, in a line what its map holds and at what hour, and the grid where walls have moved;
        called each second.
        """
        if not self._thinning.is_due(rerun_paths.HEARTBEAT):
            return
        heading = f"### {status.site} — {summary} — {datetime.now(UTC):%H:%M:%S} UTC"
        self._show(None, time(), rerun_status.draw_heading, heading)
        for name, value in self._thinning.changed(status.counters).items():
            self._show(rerun_paths.mapper_counter(name), time(), rerun_status.draw_counter, name, value)
        self._look_again()

    def show_event(self, text: str, level: str = "INFO") -> None:
        """A line in the log of events; ``level`` as INFO, WARN or ERROR."""
        self._show(None, time(), rerun_status.draw_event, rerun_paths.LOG, text, level)

    def counters(self) -> dict[str, int]:
        """What became of what was to be shown."""
        return self._link.counters()

    def close(self) -> None:
        """Show no more."""
        self._link.close()

    def _label(self, time_s: float) -> None:
        self._show(rerun_paths.LABELS, time_s, rerun_map.draw_labels, self._contour, self._here.copy())

    def _look_again(self) -> None:
        """Draw the grid's free space up to the contour's walls, if that is not where it ends already."""
        tiles = list(self._tiles.copy().values())
        if not tiles:
            return
        trails = [place for trail in self._trails.copy().values() for place in trail.copy()]
        placed = [(x_m, y_m) for x_m, y_m, _ in self._poses.values()]
        cell_m = tiles[0].cell_m
        seen = sight(self._contour, [*trails, *placed], cell_m)
        if seen is self._seen or (seen is not None and seen.is_near(self._seen, within_m=cell_m)):
            return
        self._seen = seen
        for place in list(self._tiles):
            with self._drawing_tiles:  # never an older tile over a newer one
                if (tile := self._tiles.get(place)) is not None:
                    self._show_tile(tile)

    def _show_tile(self, tile: GridTile) -> None:
        path = rerun_paths.grid_tile(keys.tile_name(tile.tile_x, tile.tile_y))
        self._show(path, _seconds(tile), rerun_map.draw_tile, tile, self._seen)

    def _show(self, subject: str | None, time_s: float, draw: Callable[..., Entries], *arguments: Any) -> None:
        sweep = sum(self._sequences.copy().values())
        self._link.put(Drawing(draw, arguments, time_s, sweep, subject))


def _seconds(message: Contour | Features | GridTile) -> float:
    return message.time.ToNanoseconds() / 1e9
