"""The demo, as `make demo` runs it, on ports of its own: from the firmware in the simulator to what people see."""

from pathlib import Path

from mapper.rerun_relay import Viewer, viewer
from system.processes import ROOT, free_ports, listens, programs, wait_until
from system.site import SITE, SURVEY_SWEEPS
from truth import compare, load_room

from noctule import rerun_paths
from noctule.client import Client
from noctule.messages_pb2 import Contour

ROOM = ROOT / "firmware/simulator/rooms/paper.toml"

# Liu et al. 2019, Tables II and III: what the paper's own rig reached.
PAPER_CORNER_ERROR_M = 0.0325
PAPER_CENTRE_ERROR_M = 0.0185
PAPER_RADIUS_ERROR_M = 0.015


def test_the_demo_maps_the_papers_room_and_its_viewer_shows_the_map(tmp_path: Path) -> None:
    names = ("UNIT", "ZENOH", "RERUN", "WEB")
    ports = dict(zip(names, free_ports(len(names)), strict=True))
    environment = {f"DEMO_{name}_PORT": str(port) for name, port in ports.items()}
    with programs(tmp_path) as running:
        running.start("demo", "python", "deploy/demo/run.py", env=environment | {"DEMO_DATA": str(tmp_path / "data")})
        contour = whole_survey(ports["ZENOH"], running.check)
        with viewer(f"rerun+http://127.0.0.1:{ports['RERUN']}/proxy", tmp_path) as late_joiner:
            for part in (
                rerun_paths.WALLS,
                rerun_paths.CORNERS,
                rerun_paths.CYLINDERS,
                rerun_paths.FEATURES,
                rerun_paths.GRID,
            ):
                wait_until(lambda part=part: shows(late_joiner, part), f"{part} is not shown")
        running.end("demo")
    assert not any(listens(port) for port in ports.values())

    comparison = compare(contour, load_room(ROOM))
    assert comparison.complete
    assert comparison.invented == 0
    assert comparison.mean_corner_error_m < PAPER_CORNER_ERROR_M
    for centre_m, radius_m in filter(None, comparison.cylinder_errors_m):
        assert centre_m < PAPER_CENTRE_ERROR_M
        assert radius_m < PAPER_RADIUS_ERROR_M


def whole_survey(zenoh_port: int, check) -> Contour:
    """The first contour that rests on every sweep of the path."""

    def newest() -> Contour | None:
        check()
        contour = client.contour()
        return contour if contour is not None and contour.sweeps >= SURVEY_SWEEPS else None

    with Client(SITE, connect=[f"tcp/127.0.0.1:{zenoh_port}"]) as client:
        return wait_until(newest, "no contour of the whole survey", within_s=240)


def shows(viewer: Viewer, part: str) -> bool:
    """The viewer has been sent something of that part of the view."""
    return any(entity.startswith(part) for entity in viewer.seen())
