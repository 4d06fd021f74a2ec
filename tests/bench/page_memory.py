"""Whether a page's memory ends: the heap of Rerun's viewer in headless Chromium, while more is drawn than it keeps.

Blobs that no view shows pass through a relay at a steady pace, so that a page without a graphics card keeps up:

    PYTHONPATH=tests python tests/bench/page_memory.py --minutes 15
"""

import argparse
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil
import rerun as rr
from system.processes import programs, repeated, wait_until
from viewer.browser import chromium, screen
from viewer.relay_rig import start_relay

from noctule import rerun_paths

SIZE_PX = (480, 320)
BLOB_BYTES, EACH_S = 300_000, 0.1
LOOK_EVERY_S = 30.0
LATE = """() => {
    const before = window.noctuleEvent;
    window.noctuleEvent = (json) => { window.noctuleTime = JSON.parse(json).time ?? window.noctuleTime; before(json); };
}"""  # when what the page shows was drawn, in nanoseconds


@contextmanager
def drawing(url: str, drawn_mb: list[float]) -> Iterator[None]:
    """Within the block blobs are drawn on the relay at ``url``, and counted."""
    recording, rng = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id="bench"), np.random.default_rng(1)
    recording.connect_grpc(url)

    def draw() -> None:
        blob = rng.integers(0, 255, BLOB_BYTES, dtype=np.uint8).tobytes()
        recording.log("hidden", rr.AnyValues(blob=blob))
        recording.log(rerun_paths.HEARTBEAT, rr.TextDocument(f"### {drawn_mb[0]:.1f} MB"))
        drawn_mb[0] += BLOB_BYTES / 1e6

    with repeated(draw, EACH_S):
        yield
    recording.disconnect()


def main() -> None:
    """Open the page, and print now and then what was drawn and how large the page and the relay are."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=15.0)
    given = parser.parse_args()
    drawn_mb = [0.0]
    with tempfile.TemporaryDirectory() as folder, programs(Path(folder)) as running:
        relay = start_relay(running)
        with drawing(relay.url, drawn_mb), chromium() as browser, screen(browser, size_px=SIZE_PX) as shown:
            shown.open(relay.page)
            wait_until(lambda: shown.page.evaluate("!!window.noctuleHeap"), "no heap", within_s=300)
            shown.page.evaluate(LATE)
            print(f"{'seconds':>8}{'drawn':>10}{'heap':>10}{'relay':>10}{'late':>8}", flush=True)
            began_s = time.monotonic()
            while (passed_s := time.monotonic() - began_s) < 60 * given.minutes:
                shown.page.wait_for_timeout(1e3 * LOOK_EVERY_S)
                heap_mb = shown.page.evaluate("window.noctuleHeap.buffer.byteLength") / 1e6
                late_s = time.time() - (shown.page.evaluate("window.noctuleTime") or 0) / 1e9
                relay_mb = max(child.memory_info().rss for child in _children(running.pid("viewer"))) / 1e6
                cells = f"{drawn_mb[0]:7.0f} MB{heap_mb:7.0f} MB{relay_mb:7.0f} MB{late_s:6.1f} s"
                print(f"{passed_s:8.0f}{cells}", flush=True)


def _children(pid: int) -> list[psutil.Process]:
    return psutil.Process(pid).children(recursive=True)


if __name__ == "__main__":
    main()
