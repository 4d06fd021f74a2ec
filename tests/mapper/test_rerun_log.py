"""What the mapper shows, read back as a viewer is sent it."""

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from time import monotonic

import numpy as np
import pytest
from mapper.rerun_relay import Viewer, relay, viewer
from PIL import Image
from system.processes import wait_until
from viewer.test_unit_pictures import components

from noctule import rerun_paths
from noctule.messages_pb2 import (
    POSE_STATE_FITTED,
    POSE_STATE_OPEN,
    POSE_STATE_WRONG,
    Contour,
    Cylinder,
    GridTile,
    Point,
    Pose,
    ServiceStatus,
    Touch,
    UnitPose,
    UnitStatus,
    Wall,
)
from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.rerun_view.log import RerunLog
from noctule_mapper.rerun_view.map import draw_sweep

QUARTER_RAD = np.pi / 2


@contextmanager
def logged(folder: Path, now: Callable[[], float] = monotonic) -> Iterator[tuple[RerunLog, Viewer]]:
    """A log by the clock ``now``, and a viewer of it."""
    with relay() as far_end:
        far_end.start()
        log = RerunLog(far_end.url, "paper-room", now)
        try:
            with viewer(far_end.url, folder) as watching:
                yield log, watching
        finally:
            log.close()


@pytest.fixture
def shown(tmp_path: Path) -> Iterator[tuple[RerunLog, Viewer]]:
    """A log, and a viewer of it."""
    with logged(tmp_path) as made:
        yield made


def readings(sequence: int, x_m: float) -> SweepReadings:
    """A unit that looks along y; one echo ahead, none to the left, a fault to the right."""
    return SweepReadings(
        identity=("8c1f", sequence),
        unit="u1",
        time_s=2_000.0 + sequence,
        x_m=x_m,
        y_m=0.0,
        heading_rad=QUARTER_RAD,
        sigma_position_m=0.0,
        sigma_heading_rad=0.0,
        bearing_rad=np.array([0.0, QUARTER_RAD, -QUARTER_RAD]),
        range_m=np.array([1.5, np.nan, np.nan]),
        no_echo=np.array([False, True, False]),
        beam_width_rad=0.4,
        range_sigma_m=0.003,
    )


def status(state: "UnitStatus.State", detail: str = "") -> UnitStatus:
    return UnitStatus(unit="u1", state=state, detail=detail, clock_error_s=0.002)


def test_walls_bear_their_lengths_and_cylinders_their_radii(shown: tuple[RerunLog, Viewer]) -> None:
    log, watching = shown
    contour = Contour(
        walls=[Wall(start=Point(x_m=0.0, y_m=0.0), end=Point(x_m=3.0, y_m=4.0))],
        cylinders=[Cylinder(x_m=1.0, y_m=2.0, radius_m=0.448)],
    )
    log.show_contour(contour)
    assert watching.values(rerun_paths.WALLS, "LineStrips2D:strips") == [[[[0.0, 0.0], [3.0, 4.0]]]]
    assert watching.values(rerun_paths.LABELS, "Points2D:labels") == [["r 0.45 m", "5.00 m"]]
    assert watching.values(rerun_paths.CYLINDERS, "Ellipses2D:half_sizes") == [[pytest.approx([0.448, 0.448])]]


def test_a_touch_is_a_bar_across_its_direction_that_bears_what_it_may_be(shown: tuple[RerunLog, Viewer]) -> None:
    log, watching = shown
    # Heard towards +x: 5 cm of error across, 2 mm along.
    touch = Touch(x_m=2.0, y_m=1.0, covariance=[4e-6, 0, 0, 25e-4], chance_wall=0.5, chance_corner=0.3)
    log.show_contour(Contour(walls=[Wall(end=Point(x_m=1.0), chance=0.997)], touches=[touch]))
    ((bar,),) = watching.values(rerun_paths.TOUCHES, "LineStrips2D:strips")
    assert bar == [pytest.approx([2.0, 0.95]), pytest.approx([2.0, 1.05])]
    assert watching.values(rerun_paths.LABELS, "Points2D:labels") == [["1.00 m, 99.7 %", "wall? 50 %"]]


def test_a_unit_has_an_ellipse_of_its_error_and_a_wrong_one_is_named_and_tied_to_its_stated_place(
    shown: tuple[RerunLog, Viewer],
) -> None:
    log, watching = shown
    # 1 cm along x and 2 cm along y, 0.05 rad.
    variances = np.diag([1e-4, 4e-4, 2.5e-3]).ravel()
    right = UnitPose(unit="u1", x_m=1.0, y_m=2.0, covariance=variances, state=POSE_STATE_FITTED)
    wrong = UnitPose(unit="u2", x_m=3.0, stated=Pose(x_m=3.3), covariance=variances, state=POSE_STATE_WRONG)
    nowhere = UnitPose(unit="u3", stated=Pose(sigma_position_m=100), state=POSE_STATE_OPEN)
    log.show_contour(Contour(poses=[right, wrong, nowhere]))
    (strips,) = watching.values(rerun_paths.POSES, "LineStrips2D:strips")
    ellipse = np.array(strips[0])
    assert len(strips) == 2 + 3  # an ellipse and a wedge each, and the way from the stated place
    assert np.ptp(ellipse, axis=0) == pytest.approx([0.04, 0.08], rel=0.01)  # two sigmas to each side
    assert strips[-1] == [pytest.approx([3.3, 0.0]), pytest.approx([3.0, 0.0])]
    assert watching.values(rerun_paths.POSES, "Points2D:labels") == [["u2: wrong pose"]]


def test_the_rays_of_a_unit_whose_pose_is_unknown_are_drawn_where_the_contour_has_found_it(
    shown: tuple[RerunLog, Viewer],
) -> None:
    log, watching = shown
    sweep = replace(readings(1, x_m=0.0), sigma_position_m=100.0)
    log.show_sweep(sweep)
    found = UnitPose(unit="u1", x_m=4.0, y_m=1.0, stated=Pose(sigma_position_m=100), state=POSE_STATE_FITTED)
    log.show_contour(Contour(poses=[found]))
    log.show_sweep(sweep)
    (rays,) = watching.values(rerun_paths.unit_rays("u1"), "LineStrips2D:strips")
    assert rays[0] == [[4.0, 1.0], pytest.approx([5.5, 1.0])]


def test_a_contour_without_objects_takes_away_what_was_shown(shown: tuple[RerunLog, Viewer]) -> None:
    log, watching = shown
    log.show_contour(Contour(walls=[Wall(end=Point(x_m=1.0))], cylinders=[Cylinder(radius_m=0.1)]))
    log.show_contour(Contour())
    assert watching.values(rerun_paths.WALLS, "LineStrips2D:strips", rows=2)[-1] == []
    assert watching.values(rerun_paths.CYLINDERS, "Ellipses2D:half_sizes", rows=2)[-1] == []


def test_rays_reach_their_echoes_and_are_short_where_nothing_was_heard(shown: tuple[RerunLog, Viewer]) -> None:
    log, watching = shown
    log.show_sweep(readings(1, x_m=0.5))
    (rays,) = watching.values(rerun_paths.unit_rays("u1"), "LineStrips2D:strips")
    assert rays == [
        [[0.5, 0.0], pytest.approx([0.5, 1.5])],
        [[0.5, 0.0], pytest.approx([0.25, 0.0], abs=1e-6)],
    ]


def test_a_unit_has_an_arrow_where_it_looks_and_the_outline_of_its_beam_about_it() -> None:
    seen = replace(readings(1, x_m=0.5), heading_rad=2.0)  # with a beam 0.4 rad wide
    drawn = components(draw_sweep(seen, []), rerun_paths.unit_pose("u1"))
    assert drawn["Points2D:positions"] == drawn["Arrows2D:origins"] == [[0.5, 0.0]]
    ((x_m, y_m),) = drawn["Arrows2D:vectors"]
    assert np.arctan2(y_m, x_m) == pytest.approx(2.0)
    (outline,) = drawn["LineStrips2D:strips"]
    assert outline[0] == outline[-1] == [0.5, 0.0]
    rim_m = np.subtract(outline[1:-1], outline[0])
    assert np.hypot(*rim_m.T) == pytest.approx(np.hypot(*rim_m[0]))
    assert np.arctan2(rim_m[[0, -1], 1], rim_m[[0, -1], 0]) == pytest.approx([1.8, 2.2])


def test_a_unit_leaves_a_trail_that_outlives_a_restart(shown: tuple[RerunLog, Viewer]) -> None:
    log, watching = shown
    log.recall_sweep(readings(1, x_m=0.0))
    log.show_sweep(readings(2, x_m=0.2))
    (chunk,) = watching.wait_for(rerun_paths.unit_trail("u1"))
    assert watching.values(rerun_paths.unit_trail("u1"), "LineStrips2D:strips") == [
        [[[0.0, 0.0], pytest.approx([0.2, 0.0])]]
    ]
    batch = chunk.to_record_batch()
    assert batch.column("time").to_pylist()[0].timestamp() == 2_002.0
    assert batch.column("sweep").to_pylist() == [2]
    (names,) = watching.wait_for(rerun_paths.LABELS)
    assert names.to_record_batch().column("time").to_pylist()[0].timestamp() == 2_002.0, "no label of 1970"


def test_a_tile_is_an_image_that_stands_where_the_tile_is(shown: tuple[RerunLog, Viewer]) -> None:
    log, watching = shown
    tile = GridTile(tile_x=-1, tile_y=2, x_m=-1.28, y_m=2.56, cell_m=0.02, columns=2, rows=1)
    tile.occupied, tile.free = bytes([240, 0]), bytes([0, 0])
    path = rerun_paths.grid_tile("-1_2")
    log.show_tiles([tile])
    assert watching.values(path, "Transform3D:translation") == [[pytest.approx([-1.28, 2.56, 0.0])]]
    ((png,),) = watching.values(path, "EncodedImage:blob")
    occupied_alpha, unknown_alpha = alphas([png])
    assert occupied_alpha == 240
    assert unknown_alpha == 0


def test_free_space_beyond_a_wall_is_dark_once_the_wall_is_found_and_occupied_cells_stay(tmp_path: Path) -> None:
    now_s, path = 0.0, rerun_paths.grid_tile("0_0")
    tile = GridTile(cell_m=0.1, columns=10, rows=1, free=bytes([240] * 9 + [0]), occupied=bytes([0] * 9 + [240]))
    with logged(tmp_path, lambda: now_s) as (log, watching):
        log.show_sweep(readings(1, x_m=0.05))
        log.show_tiles([tile])
        log.show_contour(Contour(walls=[Wall(start=Point(x_m=0.5, y_m=-3.0), end=Point(x_m=0.5, y_m=3.0))]))
        for passed_s in (0.0, 10.0, 20.0):  # drawn again once, though it is looked at every ten seconds
            now_s = passed_s
            log.show_service_status(ServiceStatus(), "1 wall")
        log.show_event("the end")
        watching.wait_for(rerun_paths.LOG)
        first, second = watching.values(path, "EncodedImage:blob", rows=2)
    assert [bool(alpha) for alpha in alphas(first)] == [True] * 10
    assert [bool(alpha) for alpha in alphas(second)] == [True] * 6 + [False] * 3 + [True]  # the wall's cell is room


def alphas(blob: list) -> list[int]:
    return np.array(Image.open(io.BytesIO(bytes(blob[0]))))[0, :, 3].tolist()


def test_a_units_state_is_shown_when_it_changes_and_its_trouble_is_told_once(shown: tuple[RerunLog, Viewer]) -> None:
    log, watching = shown
    for _ in range(3):
        log.show_unit_status(status(UnitStatus.STATE_SWEEPING))
    for _ in range(3):
        log.show_unit_status(status(UnitStatus.STATE_FAULT, "the stepper is stuck"))
    log.show_unit_status(status(UnitStatus.STATE_IDLE))
    log.show_unit_status(status(UnitStatus.STATE_DISCONNECTED, "no gateway serves it any more"))
    assert watching.values(rerun_paths.unit_log("u1"), "TextLog:text", rows=3) == [
        ["u1 fault: the stepper is stuck"],
        ["u1 is well again"],
        ["u1 disconnected: no gateway serves it any more"],
    ]
    states = watching.values(rerun_paths.unit_state("u1"), "StateChange:state", rows=4)
    assert states == [["sweeping"], ["fault"], ["idle"], ["disconnected"]]


def test_units_that_somebody_makes_up_without_end_are_not_drawn(
    shown: tuple[RerunLog, Viewer], monkeypatch: pytest.MonkeyPatch
) -> None:
    log, watching = shown
    monkeypatch.setattr("noctule.bounds.MAX_UNITS", 3)
    for number in range(50):
        log.show_unit_status(UnitStatus(unit=f"u{number}", state=UnitStatus.STATE_IDLE, detail="cold"))
    log.show_event("the end")
    for path in (rerun_paths.LOG, *(rerun_paths.unit_state(f"u{number}") for number in range(3))):
        watching.wait_for(path)
    drawn = [number for number in range(50) if rerun_paths.unit_state(f"u{number}") in str(watching.seen().keys())]
    assert drawn == [0, 1, 2]


def test_figures_that_come_each_second_are_drawn_every_ten_and_counters_only_when_they_change(tmp_path: Path) -> None:
    now_s = 0
    with logged(tmp_path, lambda: now_s) as (log, watching):
        for now_s in range(61):
            log.show_unit_status(status(UnitStatus.STATE_SWEEPING))
            log.show_service_status(ServiceStatus(counters={"contours": now_s // 20, "sweeps_unusable": 0}), "5 walls")
        log.show_event("the end")
        watching.wait_for(rerun_paths.LOG)
        # What was drawn at about the same time may come in another order.
        assert watching.values(rerun_paths.unit_clock_error("u1"), "Scalars:scalars", rows=7) == [[2.0]] * 7
        contours = watching.values(rerun_paths.mapper_counter("contours"), "Scalars:scalars", rows=4)
        assert contours == [[0.0], [1.0], [2.0], [3.0]]
        assert watching.values(rerun_paths.mapper_counter("sweeps_unusable"), "Scalars:scalars") == [[0.0]]
        assert len(watching.values(rerun_paths.HEARTBEAT, "TextDocument:text", rows=7)) == 7


def test_the_mappers_figures_come_with_a_heading_that_says_what_the_map_holds(shown: tuple[RerunLog, Viewer]) -> None:
    log, watching = shown
    log.show_service_status(ServiceStatus(site="paper-room", counters={"contours": 12}), "5 walls")
    assert watching.values(rerun_paths.mapper_counter("contours"), "Scalars:scalars") == [[12.0]]
    ((heading,),) = watching.values(rerun_paths.HEARTBEAT, "TextDocument:text")
    assert heading.startswith("### paper-room — 5 walls — ")


def test_a_relay_that_was_started_again_is_given_the_figures_that_no_longer_change(tmp_path: Path) -> None:
    with relay() as far_end:
        far_end.start()
        log = RerunLog(far_end.url, "paper-room")
        try:
            log.show_service_status(ServiceStatus(counters={"sweeps_unusable": 3}), "5 walls")
            with viewer(far_end.url, tmp_path) as watching:
                watching.wait_for(rerun_paths.mapper_counter("sweeps_unusable"))
            far_end.kill()
            far_end.start()
            with viewer(far_end.url, tmp_path) as watching:
                values = watching.values(rerun_paths.mapper_counter("sweeps_unusable"), "Scalars:scalars")
            assert values == [[3.0]]
        finally:
            log.close()


def test_two_sites_of_one_relay_are_drawn_in_one_recording_each_under_its_name(tmp_path: Path) -> None:
    with relay() as far_end:
        far_end.start()
        logs = [RerunLog(f"{far_end.url}#sites", site) for site in ("attic", "cellar")]
        try:
            with viewer(far_end.url, tmp_path) as watching:
                for number, log in enumerate(logs):
                    log.show_contour(Contour(walls=[Wall(end=Point(x_m=1.0 + number))]))
                for number, site in enumerate(("attic", "cellar")):
                    path = f"{rerun_paths.under(site)}{rerun_paths.WALLS}"
                    assert watching.values(path, "LineStrips2D:strips") == [[[[0.0, 0.0], [1.0 + number, 0.0]]]]
                    watching.wait_for(f"{rerun_paths.under(site)}{rerun_paths.WORLD}")
                assert wait_until(watching.recordings, "no recording") == {rerun_paths.ALL_SITES}
        finally:
            for log in logs:
                log.close()
