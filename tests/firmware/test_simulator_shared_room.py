"""Several simulated units in one room: they hear each other, however the run is cut into steps."""

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest
from firmware.small_rooms import FACING, range_m, refusal, room_of
from firmware.stepped_unit import IMAGE
from system.processes import PATIENCE_S

from noctule_gateway.wire.codec import FrameReader, encode
from noctule_gateway.wire.frames import (
    Configure,
    Home,
    Single,
    Sweep,
)

pytestmark = pytest.mark.usefixtures("firmware")


class Room:
    """Units that share a room, run in step."""

    def __init__(self, room: Path, *options: str):
        command = [
            "noctule-sim",
            "--control",
            "--exact-clocks",
            "--firmware",
            str(IMAGE),
            "--room",
            str(room),
            *options,
        ]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def step(self, **request: Any) -> dict[str, Any]:
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(json.dumps(request) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def close(self) -> None:
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.close()
        assert self.process.wait(PATIENCE_S) == 0
        self.process.stdout.close()


def sweeps_of_both(room: Path, steps: int, units: int = 2) -> list[list[int]]:
    """The echoes of each unit that stares ahead for a while, run in so many steps."""
    fleet = Room(room, "--units", str(units))
    try:
        fleet.step(until_s=2.0)
        # Not at the same pace, or they would miss each other every time or never.
        plans = [Configure(1, 0, 0, 64, interval_ms, 600, 100, 0, 1) for interval_ms in (40, 44)]
        fleet.step(feed=[(encode(plan) + encode(Home(2))).hex() for plan in plans[:units]])
        fleet.step(until_s=20.0)
        fleet.step(feed=[encode(Single(3)).hex()] * units)
        heard = [bytearray() for _ in range(units)]
        for step in range(1, steps + 1):
            answer = fleet.step(until_s=20.0 + 6.0 * step / steps)
            for line, sent in zip(heard, answer["sent"], strict=True):
                line += bytes.fromhex(sent)
    finally:
        fleet.close()
    echoes = []
    for line in heard:
        sweeps = [frame for frame in FrameReader().feed(bytes(line)) if isinstance(frame, Sweep)]
        echoes.append([reading.echo for reading in sweeps[0].readings])
    return echoes


def test_units_that_face_each_other_hear_each_other(tmp_path):
    room = room_of(tmp_path, FACING)
    alone = sweeps_of_both(room, 1, units=1)[0]
    assert [range_m(echo) for echo in alone] == pytest.approx([3.0] * 64, abs=1e-3)
    first, second = sweeps_of_both(room, 1)
    # At 1.5 m from one another they hear a burst at any time up to their own echo.
    assert 10 < sum(range_m(echo) < 2.99 for echo in first) < 60
    assert 5 < sum(range_m(echo) < 1.99 for echo in second) < 60


def test_how_a_shared_room_is_stepped_through_changes_nothing(tmp_path):
    room = room_of(tmp_path, FACING)
    assert sweeps_of_both(room, 1) == sweeps_of_both(room, 977)


def test_more_units_than_the_room_has_places_for_are_refused(tmp_path):
    told = refusal("--room", str(room_of(tmp_path, FACING)), "--units", "3")
    assert "places for 2 units" in told
