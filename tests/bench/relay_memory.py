"""Whether a full relay goes on growing: Rerun's relay as we start it, beside one that keeps free pages for a while.

Both get the same drawings, a grid of 90 kB among many small ones, as fast as both take them:

    PYTHONPATH=tests python tests/bench/relay_memory.py --limit 8MB --seconds 180
"""

import argparse
import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager

import numpy as np
import psutil
import rerun as rr
from system.processes import free_ports, listens, wait_until

from noctule import rerun_paths
from noctule_viewer import address, relay

LOOKS = 12
ROUND = 40  # drawings between two grids
GRID = (300, 300)


@contextmanager
def _relay(limit: str, settings: Mapping[str, str]) -> Iterator[tuple[psutil.Process, rr.RecordingStream]]:
    """A relay's process, and a stream into it."""
    port, web_port = free_ports(2)
    ports = ("--port", str(port), "--web-viewer-port", str(web_port))
    command = (str(relay.RERUN), "--serve-web", "--bind", "127.0.0.1", *ports, "--server-memory-limit", limit)
    with relay.start([*command, "--newest-first"], subprocess.DEVNULL, settings) as process:
        try:
            wait_until(lambda: listens(port) and listens(web_port), "no relay", within_s=60)
            stream = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id="bench")
            stream.connect_grpc(address.url("127.0.0.1", port))
            yield psutil.Process(process.pid), stream
            stream.disconnect()
        finally:
            process.terminate()


def _drawing(number: int, rng: np.random.Generator) -> tuple[str, rr.AsComponents]:
    if number % ROUND == 0:
        return "grid", rr.DepthImage(rng.integers(0, 255, GRID, dtype=np.uint8))
    if number % ROUND < ROUND // 2:
        return f"u{number % 2}/echoes", rr.Points2D(rng.random((int(rng.integers(5, 60)), 2)))
    return f"u{number % 2}/figure-{number % 7}", rr.Scalars(float(number))


def main() -> None:
    """Draw, and print memory (RSS) and processor time of both now and then."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--limit", default="8MB")
    parser.add_argument("--seconds", type=float, default=180.0)
    given = parser.parse_args()
    with ExitStack() as running:
        both = [running.enter_context(_relay(given.limit, settings)) for settings in (relay.GIVES_BACK, {})]
        rng, number, drawn_bytes, began_s, look_s = np.random.default_rng(1), 0, 0, time.monotonic(), 0.0
        print(f"{'seconds':>8} {'drawings':>9} {'MB':>7}   ours, and as Rerun starts it", flush=True)
        while (passed_s := time.monotonic() - began_s) < given.seconds:
            for _ in range(ROUND // 2):
                number += 1
                path, drawn = _drawing(number, rng)
                drawn_bytes += sum(batch.as_arrow_array().nbytes for batch in drawn.as_component_batches())
                for _, stream in both:
                    stream.set_time(rerun_paths.SWEEP, sequence=number)
                    stream.log(path, drawn)
            for _, stream in both:
                stream.flush()
            if passed_s >= look_s:
                look_s += given.seconds / LOOKS
                costs = "  ".join(_cost(process) for process, _ in both)
                print(f"{passed_s:8.0f} {number:9} {drawn_bytes / 1e6:7.0f}  {costs}", flush=True)


def _cost(process: psutil.Process) -> str:
    return f"{process.memory_info().rss / 1e6:6.1f} MB {sum(process.cpu_times()[:2]):6.2f} s"


if __name__ == "__main__":
    main()
