"""What the relay costs while nobody draws or watches, beside Rerun's own, started in the same minute."""

import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import psutil
from system.processes import free_ports, listens, programs, wait_until

from noctule_viewer.relay import RERUN, environment

WATCHED_S = 10.0
LIMIT = 5.0  # percent of a core, for our relay: a requirement

Row = tuple[str, float]


def rows() -> list[Row]:
    """Shares of a core in percent, each with a label."""
    port, web_port = free_ports(2)
    ports = "--port", str(port), "--web-port", str(web_port)
    with tempfile.TemporaryDirectory() as folder, programs(Path(folder)) as running:
        running.start("relay", "noctule-viewer", "run", *ports)
        wait_until(lambda: "Watch the map" in running.log("relay"), "no relay", within_s=90)
        ours = _of(psutil.Process().children(recursive=True))
        running.end("relay")
    port, web_port = free_ports(2)
    arguments = ["--serve-web", "--bind", "127.0.0.1", "--port", str(port), "--web-viewer-port", str(web_port)]
    with subprocess.Popen([RERUN, *arguments], env=environment()) as bare:
        try:
            wait_until(lambda: listens(port) and listens(web_port), "no bare relay", within_s=30)
            theirs = _of([psutil.Process(bare.pid)])
        finally:
            bare.terminate()
    return [
        (f"the idle relay with its parent and page: percent of a core; {LIMIT:g} at most", ours),
        ("`rerun --serve-web` alone, idle: percent of a core", theirs),
    ]


def table() -> list[str]:
    return [f"{number:12.2f} {what}" for what, number in rows()]


def _of(processes: Sequence[psutil.Process]) -> float:
    before_s, began_s = _processor_s(processes), time.monotonic()
    time.sleep(WATCHED_S)
    return 100.0 * (_processor_s(processes) - before_s) / (time.monotonic() - began_s)


def _processor_s(processes: Sequence[psutil.Process]) -> float:
    return sum(sum(process.cpu_times()[:2]) for process in processes)
