"""A fitted survey as a Rerun recording: the view of the live map, from a file."""

from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from noctule import rerun_paths
from noctule.messages_pb2 import Contour
from noctule_mapper.mapper import Mapper
from noctule_mapper.messages import features_message, tile_message
from noctule_mapper.rerun_view import map as rerun_map
from noctule_mapper.rerun_view.drawing import Entries
from noctule_mapper.rerun_view.sight import sight

SUMMARY = "summary"
_CALM = [17, 21, 28]


def record(path: Path, mapper: Mapper, contour: Contour, summary: str) -> None:
    """Write ``path``: for good the ``contour``, the grid, all echoes and the ``summary`` (Markdown) beside them, and
    sweep by sweep, on the timeline of their numbers, what each heard. Raises OSError where it can't be written.
    """
    path.open("wb").close()  # Rerun itself says neither which file nor why
    recording = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id=contour.site or path.stem)
    recording.save(path, default_blueprint=_layout())
    sweeps = mapper.sweeps()
    for entries in _map(mapper, contour):
        log(recording, entries, static=True)
    recording.log(SUMMARY, rr.TextDocument(summary, media_type="text/markdown"), static=True)
    trails_m: dict[str, list[tuple[float, float]]] = {}
    for number, sweep in enumerate(sweeps):
        trail_m = trails_m.setdefault(sweep.unit, [])
        trail_m.append((sweep.x_m, sweep.y_m))
        recording.set_time(rerun_paths.SWEEP, sequence=number)
        log(recording, rerun_map.draw_sweep(sweep, trail_m))
        log(recording, rerun_map.draw_labels(contour, {unit: trail[-1] for unit, trail in trails_m.items()}))
    recording.flush()
    recording.disconnect()


def log(recording: rr.RecordingStream, entries: Entries, static: bool = False) -> None:
    """Put entries into a recording, at its present time or for good."""
    for path, archetype in entries:
        recording.log(path, archetype, static=static)


def map_view() -> rrb.Spatial2DView:
    """The map as the viewer shows it."""
    # The origin is the parent of the entity that turns y upwards: a view does not apply its own origin's transform.
    return rrb.Spatial2DView(origin="/", contents=[f"/{rerun_paths.WORLD}/**"], name="Map", background=_CALM)


def _map(mapper: Mapper, contour: Contour) -> list[Entries]:
    places_m = [(sweep.x_m, sweep.y_m) for sweep in mapper.sweeps() if not sweep.pose_is_unknown]
    seen = sight(contour, places_m, mapper.config.grid.cell_m)
    tiles = [rerun_map.draw_tile(tile_message(tile, contour.site), seen) for tile in mapper.grid.tiles()]
    features = rerun_map.draw_features(features_message(mapper.feature_points(), contour.site))
    echoes = rerun_map.draw_echoes(mapper.sweeps())
    return [rerun_map.draw_frame(), *tiles, echoes, features, rerun_map.draw_contour(contour)]


def _layout() -> rrb.Blueprint:
    summary = rrb.TextDocumentView(origin=f"/{SUMMARY}", name="Contour")
    return rrb.Blueprint(
        rrb.Vertical(map_view(), summary, row_shares=[3, 1]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=rerun_paths.SWEEP),
        auto_layout=False,
        auto_views=False,
    )
