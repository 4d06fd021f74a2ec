"""A site that the pages describe, without hardware, in a folder of its own; and its commands, typed there."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

from docs.blocks import blocks
from system.processes import PATIENCE_S, ROOT, wait_until

SERIAL = 1  # of the first simulated unit
ROOM_PATH = "{ corners_m = [[0.5, 0.5], [3.5, 0.5]], spacing_m = 0.2, closed = false }"  # of the simulator's page


class Walk:
    """Types commands of the pages, and knows which it has typed."""

    def __init__(self, folder: Path, documented: set[str], endpoint: str) -> None:
        self.folder, self._documented = folder, documented
        self._environment = {name: value for name, value in os.environ.items() if "DISPLAY" not in name} | {
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "NOCTULE_CONNECT": endpoint,
            "HOME": str(folder),
            "PYTHONUNBUFFERED": "1",
        }

    def types(self, line: str, more: str = "", status: tuple[int, ...] = (0,)) -> str:
        """Run a command of the pages, with ``more`` behind it, and return all that it printed."""
        process = self.starts(line, more)
        printed = all_printed(process)
        assert process.returncode in status, f"{line}: status {process.returncode}\n{printed}"
        assert "Traceback" not in printed, f"{line}:\n{printed}"
        return printed

    def starts(self, line: str, more: str = "") -> "subprocess.Popen[str]":
        """The command as a process that goes on."""
        assert line in self._documented, f"no page has this command any more: {line}"
        return subprocess.Popen(
            ["bash", "-c", f"{'' if '&&' in line else 'exec '}{line} {more}"],
            cwd=self.folder,
            env=self._environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def types_until(self, line: str, file: Path, lines: int) -> None:
        """Run a command that goes on, with its output in ``file`` unless it writes that itself, and end it by Ctrl-C
        when the file has so many lines.
        """
        process = self.starts(line, "" if file.name in line else f"> {file.name}")
        try:
            wait_until(lambda: file.exists() and file.read_text().count("\n") >= lines, f"{lines} lines of {line}")
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE_S) == 0, line
        finally:
            process.kill()
            process.communicate()


def all_printed(process: "subprocess.Popen[str]") -> str:
    """What the process prints until its end; one that does not end is killed, which fails the test."""
    try:
        return process.communicate(timeout=PATIENCE_S)[0]
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise


def block_of(page: str, beginning: str) -> str:
    """The block of a page that begins so."""
    (found,) = [block.text for block in blocks(ROOT / page) if block.text.startswith(beginning)]
    return found + "\n"


def site_file(unit_port: int) -> str:
    """The site file of the first page, its unit a simulated one, carried as in the room of the simulator's page."""
    text = block_of("README.md", 'site = "attic"')
    text, addresses = re.subn(
        r"^address = .*$", f'address = "socket://127.0.0.1:{unit_port}"', text, flags=re.MULTILINE
    )
    text, serials = re.subn(r"^serial = \d+$", f"serial = {SERIAL}", text, flags=re.MULTILINE)
    text, paths = re.subn(r"^path = .*$", f"path = {ROOM_PATH}", text, flags=re.MULTILINE)
    assert addresses == serials == paths == 1
    return text.replace("\n", '\nclock = "unit"\n', 1)


def radar_file(path: Path, survey: Path) -> None:
    """A survey as another scanner writes it: angles with 90 degrees ahead, centimetres, 0 for no echo."""
    rows = ["angle,distance_cm,x_m,y_m,heading_deg"]
    for line in survey.read_text().splitlines():
        sweep = json.loads(line)
        pose = sweep["pose"]
        place = f"{pose.get('x_m', 0):.3f},{pose.get('y_m', 0):.3f},{57.29578 * pose.get('heading_rad', 0):.2f}"
        for reading in sweep["readings"]:
            range_cm = 100 * reading.get("time_of_flight_s", 0) * 343.2 / 2
            rows.append(f"{90 + 57.29578 * reading.get('bearing_rad', 0):.2f},{range_cm:.2f},{place}")
    path.write_text("\n".join(rows) + "\n")
