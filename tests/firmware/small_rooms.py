"""Rooms for one test each, and units that stand in them."""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from firmware.stepped_unit import IMAGE, SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import (
    Configure,
    Single,
    Sweep,
)

WALL = """
[[wall]]
from_m = [2.0, -3.0]
to_m = [2.0, 3.0]
"""
UNIT = """
[unit]
position_m = [0.0, 0.0]
"""
# 5 readings straight ahead, 60 ms apart.
STARE = Configure(0, 0, 0, 5, 60, 600, 100, 0, 1)
TICKS_PER_SECOND = 4_000_000
BEARINGS_PER_TURN = 65536
SPEED_OF_SOUND_M_S = 331.3 + 0.606 * 20.0


FACING = """
[[wall]]
from_m = [-0.5, -3.0]
to_m = [-0.5, 3.0]
[[wall]]
from_m = [3.0, -3.0]
to_m = [3.0, 3.0]
[[unit]]
position_m = [0.0, 0.0]
[[unit]]
position_m = [1.5, 0.0]
heading_deg = 180.0
"""


def room_of(tmp_path: Path, text: str) -> Path:
    room = tmp_path / "room.toml"
    room.write_text('name = "room"\n' + text)
    return room


@contextmanager
def unit_in(tmp_path: Path, text: str, *options: str) -> Iterator[SteppedUnit]:
    """A unit that has been greeted in a room of its own."""
    with stepped_unit("--room", str(room_of(tmp_path, text)), *options) as unit:
        unit.greet()
        yield unit


def stare(unit: SteppedUnit) -> list[int]:
    """The echoes of one sweep that only looks ahead."""
    unit.command(STARE)
    unit.command(Single(0))
    sweep = unit.receive(Sweep, 60)
    unit.acknowledge(sweep)
    return [reading.echo for reading in sweep.readings]


def range_m(echo: int) -> float:
    return echo / TICKS_PER_SECOND * SPEED_OF_SOUND_M_S / 2


def refusal(*options: str) -> str:
    """What the simulator says when it refuses to run."""
    command = ["noctule-sim", "--firmware", str(IMAGE), "--duration", "0.1", "--tcp", "127.0.0.1:0", *options]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 1, ended.stdout
    return ended.stderr
