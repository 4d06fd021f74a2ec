"""The log of a real robot's sonars, as a survey: fitted from its file, and replayed over the bus to a live mapper."""

import json
import math
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from google.protobuf import json_format
from mapper.live_site import message
from system.processes import free_ports, programs, wait_until

from mapper import corridor
from noctule import survey
from noctule.client import Client
from noctule.messages_pb2 import Contour, Sweep, Wall

pytestmark = pytest.mark.skipif(not corridor.FOLDER.exists(), reason="the real log is not beside the repository")

SITE = "corridor"

# The log's description: the walls that the two side sonars see over 2.0 m < x < 9.5 m are parallel within 0.4 degrees
# and about 2.12 m apart, by simple line fits that leave 25 mm RMS each.
CORRIDOR_X_M = (2.0, 9.5)
PARALLEL_RAD = math.radians(1.0)
WIDTH_M = (2.05, 2.20)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log converted to a survey."""
    path = tmp_path_factory.mktemp("corridor") / "corridor.jsonl"
    with path.open("w") as file:
        survey.write(corridor_sweeps(), file)
    return path


def corridor_sweeps() -> Iterator[Sweep]:
    for sequence, readings in enumerate(corridor.sweeps()):
        sweep = message(readings)
        sweep.site = SITE
        sweep.sequence = sequence
        yield sweep


def test_fitting_the_log_finds_the_two_walls_of_the_corridor(log: Path, tmp_path: Path) -> None:
    output = tmp_path / "contour.json"
    subprocess.run(["noctule-mapper", "fit", str(log), "--contour", str(output)], check=True, timeout=120)
    contour = json_format.ParseDict(json.loads(output.read_text()), Contour())
    assert_corridor(contour)


def test_a_live_mapper_finds_the_two_walls_when_the_log_is_replayed_over_zenoh(log: Path, tmp_path: Path) -> None:
    (port,) = free_ports(1)
    endpoint = f"tcp/127.0.0.1:{port}"
    newest = max(sweep.start.ToNanoseconds() for sweep in corridor_sweeps())

    def mapped() -> Contour | None:
        running.check()
        contour = client.contour()
        return contour if contour is not None and contour.time.ToNanoseconds() >= newest else None

    with programs(tmp_path) as running:
        running.start("replay", "noctule", "replay", str(log), "--site", SITE, "--speed", "max", "--listen", endpoint)
        running.start(
            *("mapper", "noctule-mapper", "run", "--site", SITE, "--data", str(tmp_path), "--connect", endpoint),
            *("--rerun", "none"),
        )
        with Client(SITE, connect=[endpoint]) as client:
            contour = wait_until(mapped, "no contour that rests on the last sweep")
        running.end("mapper")
        running.end("replay")
    assert_corridor(contour)


def assert_corridor(contour: Contour) -> None:
    """The two walls that run along the most of the corridor are parallel and as far apart as the log says."""
    walls = sorted(contour.walls, key=length_in_corridor_m)[-2:]
    assert [length_in_corridor_m(wall) > 0.5 * (CORRIDOR_X_M[1] - CORRIDOR_X_M[0]) for wall in walls] == [True, True]
    (angle_a, angle_b) = (wall.theta_rad % math.pi for wall in walls)
    apart = abs(angle_a - angle_b)
    assert min(apart, math.pi - apart) < PARALLEL_RAD
    middle_m = sum(CORRIDOR_X_M) / 2
    low_m, high_m = sorted(y_at(wall, middle_m) for wall in walls)
    assert WIDTH_M[0] < (high_m - low_m) * abs(math.sin(walls[0].theta_rad)) < WIDTH_M[1]


def length_in_corridor_m(wall: Wall) -> float:
    """How much of the corridor's length the wall runs along."""
    low_m, high_m = sorted((wall.start.x_m, wall.end.x_m))
    return max(0.0, min(high_m, CORRIDOR_X_M[1]) - max(low_m, CORRIDOR_X_M[0]))


def y_at(wall: Wall, x_m: float) -> float:
    """Where the wall's line is at ``x_m``."""
    return (wall.rho_m - x_m * math.cos(wall.theta_rad)) / math.sin(wall.theta_rad)
