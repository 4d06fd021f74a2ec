"""The viewer as people get it: the relay with its layout, and the picture that the layout makes of a map."""

import io
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar
from urllib.request import urlopen

import numpy as np
import psutil
import pytest
import rerun as rr
from mapper.rerun_relay import Viewer
from mapper.rerun_relay import viewer as late_joiner
from PIL import Image
from rerun.experimental import ViewerClient
from system.processes import PATIENCE_S, Programs, free_ports, listens, programs, wait_until

from noctule import bus, keys, rerun_paths
from noctule.client import Client
from noctule.messages_pb2 import GridTile, ServiceStatus, UnitStatus
from noctule_mapper.rerun_view.map import draw_tile
from noctule_viewer import memory_limit
from noctule_viewer.board.layout import Layout, blueprint_of
from noctule_viewer.board.map_box import MapBox
from noctule_viewer.cli.recordings import native_viewer as native_viewer_command
from noctule_viewer.memory_limit import MemoryLimitError
from noctule_viewer.relay import RERUN, Relay

T = TypeVar("T")
WALL, CYLINDER, MARK = (255, 255, 255), (255, 140, 66), (0, 255, 0)


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Programs]:
    with programs(tmp_path) as made:
        yield made


def start_relay(running: Programs, *options: str, again: Relay | None = None) -> Relay:
    """A relay with its page, on new ports or, ``again``, on those of one that has ended."""
    port, web_port = (again.port, again.web_port) if again else free_ports(2)
    relay = Relay("127.0.0.1", port, web_port, "64MB")
    running.start("viewer", "noctule-viewer", "run", "--port", str(port), "--web-port", str(web_port), *options)
    wait_until(lambda: running.check() or (listens(port) and listens(web_port)), "the relay does not listen")
    return relay


@contextmanager
def native_viewer(relay: Relay) -> Iterator[ViewerClient]:
    """A viewer without a screen that shows what the relay has."""
    (port,) = free_ports(1)
    arguments = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", "1280x760"]
    process = subprocess.Popen([RERUN, relay.url, *arguments], env=os.environ | {"RUST_LOG": "error"})
    try:
        wait_until(lambda: listens(port) or process.poll() is not None, "the viewer does not listen")
        assert process.poll() is None, "the viewer has ended"
        yield ViewerClient(f"rerun+http://127.0.0.1:{port}/proxy")
    finally:
        process.terminate()
        process.wait()


def asked(question: Callable[[], T]) -> T:
    """What a viewer answers. A busy machine takes longer than the 15 s that Rerun waits for it."""

    answers = list[T]()

    def answered() -> bool:
        with suppress(TimeoutError):
            answers.append(question())
        return bool(answers)

    wait_until(answered, "the viewer does not answer")
    return answers[0]


def picture_of(viewer: ViewerClient) -> np.ndarray:
    """What is shown, (height, width, 3) bytes."""
    return np.array(Image.open(io.BytesIO(asked(viewer.take_screenshot))).convert("RGB"))


def log_room(relay: Relay) -> None:
    """A wall, a cylinder and a unit that was not there when the layout was made."""
    recording = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id="paper-room")
    recording.connect_grpc(relay.url)
    recording.set_time(rerun_paths.TIME, timestamp=1_800_000_000.0)
    recording.log(rerun_paths.WORLD, rr.Transform3D(mat3x3=[[1, 0, 0], [0, -1, 0], [0, 0, 1]]), static=True)
    wall = rr.LineStrips2D([[[0, 2], [3, 2]]], colors=[WALL], radii=rr.Radius.ui_points(5))
    recording.log(rerun_paths.WALLS, wall)
    cylinder = rr.Ellipses2D(
        centers=[[1, 0]], half_sizes=[[0.5, 0.5]], colors=[CYLINDER], line_radii=rr.Radius.ui_points(5)
    )
    recording.log(rerun_paths.CYLINDERS, cylinder)
    recording.log(rerun_paths.unit_state("u9"), rr.StateChange(state="sweeping"))
    recording.log(rerun_paths.unit_clock_error("u9"), rr.Scalars(0.2))
    recording.log(rerun_paths.unit_log("u9"), rr.TextLog("u9 is well again"))
    recording.flush(timeout_sec=PATIENCE_S)
    recording.disconnect()


def log_tile(relay: Relay, tile: GridTile) -> None:
    """A tile of the grid, as the mapper draws it."""
    recording = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id="paper-room")
    recording.connect_grpc(relay.url)
    recording.set_time(rerun_paths.TIME, timestamp=1_800_000_000.0)
    for path, archetype in draw_tile(tile):
        recording.log(path, archetype)
    recording.flush()


def middle_row(picture: np.ndarray, colour: tuple[int, int, int]) -> float | None:
    """Middle of the pixels that are nearly of that colour; None where they are too few to be a drawn line."""
    rows, _ = np.nonzero(np.abs(picture.astype(int) - colour).max(axis=-1) < 24)
    return float(np.median(rows)) if len(rows) > 1000 else None


def viewer_processes(running: Programs) -> list[psutil.Process]:
    """The command that this test has started, and the relay below it."""
    command = psutil.Process(running.pid("viewer"))
    return [command, *command.children(recursive=True)]


def processor_s(processes: list[psutil.Process]) -> float:
    return sum(sum(process.cpu_times()[:2]) for process in processes)


def test_one_address_is_printed_and_opens_the_page(running: Programs) -> None:
    relay = start_relay(running)
    (line,) = wait_until(lambda: re.findall("^Watch the map at (.*)$", running.log("viewer"), re.M), "no address")
    assert line == relay.page
    with urlopen(line) as page:
        assert b"<title>Rerun Viewer</title>" in page.read()
    running.end("viewer")
    assert not listens(relay.port)
    assert not listens(relay.web_port)


def test_the_relay_shows_on_the_bus_of_its_site_how_it_is_and_which_mapper_has_another_rerun(running: Programs) -> None:
    (port,) = free_ports(1)
    endpoint = f"tcp/127.0.0.1:{port}"
    start_relay(running, "--site", "house", "--connect", endpoint)  # it does not wait for the router
    with bus.open_session(listen=[endpoint]) as session, Client("house", session=session) as client:
        got: list[ServiceStatus] = []
        client.on_service_status(got.append)
        wait_until(lambda: got and not got[-1].detail, "no status came that says that all is well")
        assert (got[-1].site, got[-1].name, got[-1].role) == ("house", "viewer", "viewer")
        publisher = bus.StatePublisher(session, keys.service_status("house", "old"), ServiceStatus)

        def told() -> bool:
            publisher.put(ServiceStatus(site="house", name="old", role="mapper", rerun="0.40.2"))
            return got[-1].detail.startswith(f"old draws with 0.40.2, and this relay is Rerun {got[0].rerun}: install")

        wait_until(told, "a mapper with another Rerun is not told", every_s=0.5)
        publisher.put(ServiceStatus(site="house", name="old", role="mapper", rerun=got[0].rerun))
        wait_until(lambda: got[-1].detail == "", "a mapper with the same Rerun is told")
        publisher.put(ServiceStatus(site="house", name="old", role="mapper", rerun_recording="sites"))
        takes_off = "what old draws is not seen here, because this page shows one site: take #sites off its --rerun"
        wait_until(lambda: got[-1].detail == takes_off, "a mapper that draws for a page of several sites is not told")
        publisher.put(ServiceStatus(site="house", name="old", role="mapper", rerun_recording="house"))
        wait_until(lambda: got[-1].detail == "", "a mapper that draws for this page is told")
        publisher.close()
        running.end("viewer")


def test_a_unit_that_appears_on_a_watched_site_comes_into_alarms_and_table_and_gets_its_tab(
    running: Programs, tmp_path: Path
) -> None:
    (port,) = free_ports(1)
    endpoint = f"tcp/127.0.0.1:{port}"
    with bus.open_session(listen=[endpoint]) as session:
        relay = start_relay(running, "--site", "house", "--connect", endpoint)
        with late_joiner(relay.url, tmp_path) as watching:
            wait_for_text(watching, rerun_paths.ALARMS, "no mapper maps this site")
            token = session.liveliness().declare_token(keys.alive("house", "u1"))
            publisher = bus.StatePublisher(session, keys.unit_status("house", "u1"), UnitStatus)
            stuck = UnitStatus(site="house", unit="u1", state=UnitStatus.STATE_FAULT, detail="it is stuck")

            def again() -> None:
                publisher.put(stuck)  # a gateway that is silent for ten seconds is away

            wait_for_text(watching, rerun_paths.UNITS_TABLE, ": fault: it is stuck", again)
            wait_for_text(watching, rerun_paths.unit_sheet("u1"), "### u1 — needs attention", again)
            wait_until(lambda: "u1" in watching.names_in_layouts(), "no tab")
            token.undeclare()
            publisher.close()
            wait_for_text(watching, rerun_paths.ALARMS, "1 of 1 unit needs attention: u1: no gateway serves it")
        running.end("viewer")


def wait_for_text(watching: Viewer, path: str, words: str, meanwhile: Callable[[], None] = lambda: None) -> None:
    def said() -> bool:
        meanwhile()
        return any(words in text for (text,) in watching.values(path, "TextDocument:text"))

    wait_until(said, f"{path} does not say {words!r}", every_s=0.5)


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


def test_an_idle_relay_leaves_the_processor_alone(running: Programs) -> None:
    start_relay(running)
    wait_until(lambda: "Watch the map" in running.log("viewer"), "no address")
    tree = viewer_processes(running)
    # A busy process beside it gets what a busy relay would get, however loaded the machine is: with a layout file as
    # its source Rerun 0.41 was as busy as that.
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy:
        try:
            before_s, beside = processor_s(tree), [psutil.Process(busy.pid)]
            wait_until(lambda: processor_s(beside) > 1.5, "nothing gets the processor")
            took_s, busy_s = processor_s(tree) - before_s, processor_s(beside)
        finally:
            busy.kill()
    assert took_s < busy_s / 3


def test_a_viewer_that_comes_late_gets_the_layout_once_and_no_empty_recording(
    running: Programs, tmp_path: Path
) -> None:
    relay = start_relay(running)
    with late_joiner(relay.url, tmp_path) as watching:
        layout = wait_until(watching.layouts, "no layout")
        assert layout == [rerun_paths.APPLICATION_ID]
        assert watching.seen() == {}


def test_the_relay_ends_with_the_command_that_started_it_even_if_that_is_killed(running: Programs) -> None:
    relay = start_relay(running)
    command, process = viewer_processes(running)
    command.kill()
    wait_until(lambda: not process.is_running(), "the relay lives on")
    assert not listens(relay.port)


def test_a_relay_that_dies_ends_the_command_with_its_status(running: Programs) -> None:
    start_relay(running)
    command, process = viewer_processes(running)
    process.kill()
    assert command.wait(PATIENCE_S) == 128 + signal.SIGKILL
    assert "the relay ended by itself, with status -9" in running.log("viewer")


def test_a_port_that_is_taken_is_named(running: Programs) -> None:
    relay = start_relay(running)
    second = run_viewer("run", "--port", str(relay.port), "--web-port", str(relay.web_port))
    assert second.returncode == 1
    said = f"can't listen on 127.0.0.1:{relay.port}: port {relay.port} is in use by rerun (process "
    assert said in second.stderr and "stop that, or name another port" in second.stderr


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("run", "--port", "99999"), "it is '99999': give 65535 or less"),
        (
            ("run", "--bind", "192.0.2.1"),
            "Cannot assign requested address: name another address",
        ),
        (("open", "--url", "foo"), "foo is no relay: give rerun+http://127.0.0.1:9876/proxy"),
        (("run", "--floor-plan-at", "1,2,90"), "a floor plan belongs to a site: give --site too"),
        (("run", "--port", "9090", "--web-port", "9090"), "both 9090: give each a port of its own"),
        (("run", "--tls", "viewer"), "--tls is for the bus, on which a site is watched: give --site too"),
        (("days", "no_such_folder"), "there are no recordings in no_such_folder: noctule-viewer run --record"),
    ],
)
def test_what_no_relay_can_be_is_refused_in_one_line(arguments: tuple[str, ...], told: str) -> None:
    ended = run_viewer(*arguments)
    assert ended.returncode in (1, 2)
    assert told in " ".join(ended.stderr.split()) and "Traceback" not in ended.stderr


@pytest.mark.parametrize(
    ("limit", "told"),
    [
        ("lots", "--memory-limit 'lots' is no amount of memory: write it like 64MB or 1GB"),
        ("64", "--memory-limit '64' is no amount of memory: write it like 64MB or 1GB"),
        ("1MB", "--memory-limit 1MB is too little to keep a map: at least 8MB"),
    ],
)
def test_a_memory_limit_that_is_none_is_refused_before_anything_is_started(limit: str, told: str) -> None:
    with pytest.raises(MemoryLimitError, match=re.escape(told)):
        memory_limit.checked(limit)


@pytest.mark.parametrize("limit", ["64MB", "8 MB", "1.5GB", "64MiB"])
def test_a_memory_limit_may_be_written_as_rerun_takes_it(limit: str) -> None:
    assert memory_limit.checked(limit) == limit


def test_where_there_is_no_screen_the_address_is_told() -> None:
    told = run_viewer("open", "--url", "rerun+http://127.0.0.1:4711/proxy")
    assert told.returncode == 0
    assert "rerun+http://127.0.0.1:4711/proxy" in told.stdout


def test_where_there_is_no_screen_what_to_do_with_a_recording_is_told(tmp_path: Path) -> None:
    recording = tmp_path / "map.rrd"
    missing = run_viewer("open", str(recording))
    assert missing.returncode == 1
    assert f"there is no file {recording}" in missing.stderr
    recording.write_bytes(b"")
    told = run_viewer("open", str(recording))
    assert told.returncode == 0
    assert (
        told.stdout == f"There is no screen here. Copy {recording} to where there is one: noctule-viewer open map.rrd\n"
    )


def test_a_native_viewer_of_a_relay_drops_the_oldest_and_one_of_a_recording_shows_all(tmp_path: Path) -> None:
    url = "rerun+http://127.0.0.1:4711/proxy"
    assert native_viewer_command([], url)[1:4] == [url, "--memory-limit", "1GB"]
    assert "--memory-limit" not in native_viewer_command([tmp_path / "map.rrd"], url)


def run_viewer(*arguments: str) -> subprocess.CompletedProcess[str]:
    """noctule-viewer to its end, without a screen."""
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [Path(sys.executable).with_name("noctule-viewer"), *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PATIENCE_S)
