"""The picture that the layout makes of a map, in a native viewer without a screen."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from system.processes import PATIENCE_S, Programs, programs, wait_until
from viewer.relay_rig import CYLINDER, WALL, asked, log_room, middle_row, native_viewer, picture_of, start_relay

from noctule import rerun_paths
from noctule.messages_pb2 import GridTile
from noctule_mapper.rerun_view.map import draw_tile
from noctule_viewer.board.layout import Layout, blueprint_of
from noctule_viewer.board.map_box import MapBox
from noctule_viewer.relay import Relay

MARK = (0, 255, 0)


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Programs]:
    with programs(tmp_path) as made:
        yield made


def log_tile(relay: Relay, tile: GridTile) -> None:
    """A tile of the grid, as the mapper draws it."""
    recording = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id="paper-room")
    recording.connect_grpc(relay.url)
    recording.set_time(rerun_paths.TIME, timestamp=1_800_000_000.0)
    for path, archetype in draw_tile(tile):
        recording.log(path, archetype)
    recording.flush()


def test_the_map_stands_upright_and_no_view_reports_an_error(running: Programs) -> None:
    relay = start_relay(running)
    log_room(relay)
    with native_viewer(relay) as viewer:

        def rows() -> tuple[float, float] | None:
            picture = picture_of(viewer)
            wall, cylinder = middle_row(picture, WALL), middle_row(picture, CYLINDER)
            return None if wall is None or cylinder is None else (wall, cylinder)

        wall_row, cylinder_row = wait_until(rows, "wall and cylinder are not to be seen", every_s=0.5)
        views = {view.name: view.reports for view in asked(viewer.get_state).views}
    assert wall_row < cylinder_row, "the wall at y = 2 m should lie above the cylinder at y = 0 m"
    assert set(views) == {"Noctule", "Map", "States of the units", "Clock error, ms", "Contour, ms", "Events"}
    assert not any(views.values())


def test_time_travel_does_not_move_the_map_of_a_watched_site(running: Programs) -> None:
    relay = start_relay(running)
    log_room(relay)
    before_s = time.time()
    recording = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id="paper-room")
    recording.connect_grpc(relay.url)
    layout = blueprint_of([Layout((), MapBox(-1.0, -1.0, 4.0, 3.0))])
    recording.send_blueprint(layout, make_active=True, make_default=True)
    # What shows all there is would shrink the room to a spot for the far point, which comes with a mark in the room.
    far_away = rr.Points2D([[90, 90], [2.5, 0.5]], colors=[WALL, MARK], radii=rr.Radius.ui_points(12))
    recording.log(rerun_paths.CORNERS, far_away)
    recording.flush(timeout_sec=PATIENCE_S)
    recording.disconnect()
    with native_viewer(relay) as viewer:

        def wall(with_mark: bool) -> tuple[float, float] | None:
            picture = picture_of(viewer)[:, :700].astype(int)
            near_wall, near_mark = (np.abs(picture - colour).max(axis=-1) < 24 for colour in (WALL, MARK))
            if bool(near_mark.sum() > 100) != with_mark or near_wall.sum() < 1000:
                return None
            rows, columns = np.nonzero(near_wall)
            return float(np.median(rows)), float(np.median(columns))

        def stands_still(with_mark: bool) -> tuple[float, float]:
            def twice_the_same() -> tuple[float, float] | None:
                place = wall(with_mark)
                return place if place == wall(with_mark) else None

            return wait_until(twice_the_same, f"no wall that stands still, with the mark: {with_mark}", every_s=0.5)

        present = stands_still(with_mark=True)
        asked(lambda: viewer.set_time("log_time", timestamp=before_s, play_state="paused"))
        assert stands_still(with_mark=False) == present


def test_cells_of_the_grid_that_nobody_has_looked_into_are_as_dark_as_the_ground(running: Programs) -> None:
    relay = start_relay(running)
    log_room(relay)
    half = bytes([255] * 32 + [0] * 32) * 64
    log_tile(relay, GridTile(rows=64, columns=64, cell_m=0.05, free=half, occupied=bytes(64 * 64)))
    with native_viewer(relay) as viewer:

        def colours() -> set[tuple[int, ...]]:
            picture = picture_of(viewer)
            ground = picture[200:700, 20:880]  # of the map, clear of what stands around it
            found, counts = np.unique(ground.reshape(-1, 3), axis=0, return_counts=True)
            return {tuple(map(int, colour)) for colour in found[counts > 1000]}

        wait_until(lambda: any(colour[2] > 50 for colour in colours()), "the tile is not to be seen")
        assert (0, 0, 0) not in colours()
