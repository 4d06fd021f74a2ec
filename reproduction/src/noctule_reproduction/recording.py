"""The survey of one seed as a Rerun recording: the live view sweep by sweep, and the figures beside it."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from noctule import rerun_paths
from noctule_mapper.mapper import Mapper
from noctule_mapper.messages import contour_message, features_message, tile_message
from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.rerun_view import map as rerun_map
from noctule_mapper.rerun_view.drawing import Entries
from noctule_mapper.rerun_view.recording import log, map_view

FIGURES = "figures"
REPORT = "report"
_SITE = "paper-room"


def record(path: Path, name: str, sweeps: Sequence[SweepReadings], pictures: Mapping[str, bytes], report: str) -> None:
    """Write ``path``: the map as it grows with ``sweeps``, on the timeline of the sweeps' numbers, and for good the
    ``pictures`` (PNG by name) and the ``report`` (Markdown).
    """
    recording = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id=name)
    recording.save(path, default_blueprint=_layout(list(pictures)))
    log(recording, rerun_map.draw_frame(), static=True)
    recording.log(REPORT, rr.TextDocument(report, media_type="text/markdown"), static=True)
    for picture, png in pictures.items():
        image = rr.EncodedImage(contents=png, media_type="image/png")
        recording.log(f"{FIGURES}/{picture}", image, static=True)
    mapper = Mapper()
    trail_m: list[tuple[float, float]] = []
    for number, sweep in enumerate(sweeps):
        recording.set_time(rerun_paths.SWEEP, sequence=number)
        mapper.register_sweep(sweep)
        trail_m.append((sweep.x_m, sweep.y_m))
        log(recording, rerun_map.draw_sweep(sweep, trail_m))
        for entries in _map(mapper, {sweep.unit: trail_m[-1]}):
            log(recording, entries)
    recording.flush()
    recording.disconnect()


def _map(mapper: Mapper, units_m: Mapping[str, tuple[float, float]]) -> list[Entries]:
    """What the mapper has at this moment, as the live mapper shows it."""
    tiles = [rerun_map.draw_tile(tile_message(tile, _SITE)) for tile in mapper.grid.changed()]
    features = rerun_map.draw_features(features_message(mapper.feature_points(), _SITE))
    contour = contour_message(mapper.contour(), _SITE)
    return [*tiles, features, rerun_map.draw_contour(contour), rerun_map.draw_labels(contour, units_m)]


def _layout(pictures: Sequence[str]) -> rrb.Blueprint:
    """The map with the report beside it, and a tab for each picture."""
    report = rrb.TextDocumentView(origin=f"/{REPORT}", name="Report")
    tabs = [rrb.Spatial2DView(origin=f"/{FIGURES}/{picture}", name=picture) for picture in pictures]
    return rrb.Blueprint(
        rrb.Tabs(rrb.Horizontal(map_view(), report, column_shares=[3, 2], name="Survey"), *tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(timeline=rerun_paths.SWEEP),
        auto_layout=False,
        auto_views=False,
    )
