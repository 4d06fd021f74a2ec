"""The site that the pages describe, without hardware: its files, and a simulator, a gateway and a mapper that run."""

import json
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from docs.blocks import blocks
from docs.walk import Walk, kill
from mapper.live_site import paper_survey
from system.processes import END_WITHIN_S, ROOT, free_ports, listens, wait_until

from mapper import wall_survey
from noctule import survey
from noctule.client import Client

ROOM_PATH = "{ corners_m = [[0.5, 0.5], [3.5, 0.5]], spacing_m = 0.2, closed = false }"  # of the simulator's page
UNITS = {"attic": {"u7": 1, "u1": 2}, "site": {"u3": 3}}  # by site file: unit and serial number; u3 is left to a test
STARTED = {  # with the test's own ports behind them, which running_site() fills in
    "noctule-sim --room attic-room.toml": "--units 3 --speed 12 --exact-clocks --tcp 127.0.0.1:{first_port}",
    "noctule-gateway run attic.toml --data gateway-data": "--listen {endpoint}",
    "noctule-mapper run --site attic --data mapper-data": "--connect {endpoint} --rerun none",
}
"""The lines of the pages that start the site's programs."""


@contextmanager
def running_site(folder: Path) -> Iterator[str]:
    """Its files are written into ``folder`` and its programs started there; the endpoint of its bus."""
    first_port, _, _, zenoh_port = free_ports(4)
    write_files(folder, first_port)
    endpoint = f"tcp/127.0.0.1:{zenoh_port}"
    walk = Walk(folder, endpoint)
    started: dict[Path, subprocess.Popen[bytes]] = {}

    def all_run() -> bool:
        for log, process in started.items():
            assert process.poll() is None, f"{log.stem} ended with {process.returncode}:\n{log.read_text()}"
        return True

    try:
        for line, ours in STARTED.items():
            log = folder / f"{line.split()[0]}.log"
            started[log] = walk.starts(line, log, ours.format(first_port=first_port, endpoint=endpoint))
        wait_until(lambda: all_run() and listens(zenoh_port), "no router")  # a client would wait for ever for one
        with Client("attic", connect=[endpoint]) as client:
            wait_until(lambda: all_run() and client.contour() is not None, "no map")
        yield endpoint
    finally:
        for process in started.values():
            process.terminate()
        for process in started.values():
            with suppress(subprocess.TimeoutExpired):
                process.wait(END_WITHIN_S)
            kill(process)


def write_files(folder: Path, unit_port: int) -> None:
    """Site files, the room, surveys and other scanners' files. The units have the ports from ``unit_port`` on."""
    (folder / "firmware").symlink_to(ROOT / "firmware")
    (folder / "attic-room.toml").write_text(block_of("firmware/simulator/README.md", 'name = "attic"'))
    for site, serials in UNITS.items():
        (folder / f"{site}.toml").write_text(site_file(site, serials, unit_port))
    sweeps = paper_survey()
    for name, of_it in (("paper.jsonl", sweeps), ("wall.jsonl", wall_survey.sweeps(wall_survey.ranges_m(1)))):
        with (folder / name).open("w") as stream:
            survey.write(of_it, stream)
    for name in ("radar.csv", "walk.csv"):
        radar_file(folder / name, folder / "paper.jsonl")
    (folder / "radar.txt").write_text("".join(f"{angle},{100 + angle / 10},.\n" for angle in range(15, 166)))


def block_of(page: str, beginning: str) -> str:
    """The block of a page that begins so."""
    (found,) = [block.text for block in blocks(ROOT / page) if block.text.startswith(beginning)]
    return found + "\n"


def site_file(name: str, serials: dict[str, int], unit_port: int) -> str:
    """The site file of the first page, its units simulated, carried as in the room of the simulator's page."""
    head, mark, unit = block_of("README.md", 'site = "attic"').partition("[[unit]]")
    text = head.replace("attic", name) + 'clock = "unit"\n\n'
    for unit_name, serial in serials.items():
        address = f'"socket://127.0.0.1:{unit_port + serial - 1}"'
        for key, value in {"name": f'"{unit_name}"', "serial": serial, "address": address, "path": ROOM_PATH}.items():
            unit, found = re.subn(rf"^{key} = .*$", f"{key} = {value}", unit, flags=re.MULTILINE)
            assert found == 1
        text += mark + unit
    return text


def radar_file(path: Path, survey_file: Path) -> None:
    """A survey as another scanner writes it: angles with 90 degrees ahead, centimetres, 0 for no echo."""
    rows = ["angle,distance_cm,x_m,y_m,heading_deg"]
    for line in survey_file.read_text().splitlines():
        sweep = json.loads(line)
        pose = sweep["pose"]
        place = f"{pose.get('x_m', 0):.3f},{pose.get('y_m', 0):.3f},{57.29578 * pose.get('heading_rad', 0):.2f}"
        for reading in sweep["readings"]:
            range_cm = 100 * reading.get("time_of_flight_s", 0) * 343.2 / 2
            rows.append(f"{90 + 57.29578 * reading.get('bearing_rad', 0):.2f},{range_cm:.2f},{place}")
    path.write_text("\n".join(rows) + "\n")
