"""A relay and a native viewer of it as people get them, and a room that is drawn there."""

import io
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar

import numpy as np
import rerun as rr
from PIL import Image
from rerun.experimental import ViewerClient
from system.processes import PATIENCE_S, Programs, free_ports, listens, wait_until

from noctule import rerun_paths
from noctule_viewer.relay import RERUN, Relay

T = TypeVar("T")
WALL, CYLINDER = (255, 255, 255), (255, 140, 66)


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


def middle_row(picture: np.ndarray, colour: tuple[int, int, int]) -> float | None:
    """Middle of the pixels that are nearly of that colour; None where they are too few to be a drawn line."""
    rows, _ = np.nonzero(np.abs(picture.astype(int) - colour).max(axis=-1) < 24)
    return float(np.median(rows)) if len(rows) > 1000 else None


def run_viewer(*arguments: str) -> subprocess.CompletedProcess[str]:
    """noctule-viewer to its end, without a screen."""
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [Path(sys.executable).with_name("noctule-viewer"), *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PATIENCE_S)
