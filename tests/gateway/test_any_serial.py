"""Whatever comes over a line, the unit's server goes on, and what it tells of the unit is within the bounds."""

import json
import time
import zlib
from pathlib import Path

import pytest
from cobs import cobs
from gateway.model_unit import ModelUnit
from hypothesis import given, settings
from hypothesis import strategies as st

from noctule import bounds
from noctule.messages_pb2 import CommandRequest, Sweep, SweepPlan, UnitStatus
from noctule.site import FixedPose, Pose2, Sensor, Site, Unit
from noctule_gateway.clock.clock_watch import ClockWatch
from noctule_gateway.log.log_file import Retention
from noctule_gateway.log.sweep_log import SweepLog
from noctule_gateway.pose import PoseTrack
from noctule_gateway.served_unit import ServedUnit
from noctule_gateway.unit.unit_server import UnitServer
from noctule_gateway.update.admission import Admission

VECTORS = json.loads((Path(__file__).parents[1] / "firmware" / "vectors" / "frames.json").read_text())
CONTENTS = [bytes.fromhex(vector["content"]) for vector in VECTORS]
STEP_S = 0.1
CRC_BYTES = 4

# Bytes of a frame that become others; the position is a share of its length.
ALTERATIONS = st.lists(
    st.tuples(st.floats(0, 0.999), st.sampled_from([0, 1, 0x7F, 0x80, 0xFF]) | st.integers(0, 255)), max_size=4
)


def on_the_line(content: bytes) -> bytes:
    return cobs.encode(content + zlib.crc32(content).to_bytes(CRC_BYTES, "little")) + b"\x00"


def altered(content: bytes, alterations: list[tuple[float, int]]) -> bytes:
    """The frame with some of its bytes others, under a checksum that fits; its type and request number stay."""
    changed = bytearray(content)
    for share, value in alterations:
        changed[min(2, len(content) - 1) + int(share * max(len(content) - 2, 1))] = value
    return on_the_line(bytes(changed))


# What comes in place of the unit's own answer: that with other values, any frame, or any bytes.
ANSWERS = ALTERATIONS | st.sampled_from(CONTENTS).map(on_the_line) | st.binary(max_size=30)


class Desk:
    """A unit's server without a line, in a time of its own, and all that it tells."""

    def __init__(self, folder: Path, log: SweepLog) -> None:
        unit = Unit("u1", 7, "socket://h:1", FixedPose(Pose2(0, 0, 0)), Sensor(), SweepPlan(pings=3), True, 0.5)
        self.told: list[UnitStatus] = []
        self.published: list[bytes] = []
        kept = ServedUnit(Site("s", (unit,), None, "utc"), unit, log, PoseTrack(), ClockWatch(folder / "clock.json"))
        self.server = UnitServer(kept, self.published.append, self.told.append, Admission())
        self.now_s = time.monotonic()
        self.unit = ModelUnit(7, born_s=self.now_s)
        self.server.opened(self.now_s)

    def step(self, answer: list[tuple[float, int]] | bytes) -> None:
        """Let the server speak, and give it an answer."""
        self.now_s += STEP_S
        self.server.advance(self.now_s)
        self.unit.receive(self.server.output(self.now_s), self.now_s)
        sound = self.unit.output(self.now_s)
        if isinstance(answer, list):
            contents = [cobs.decode(piece)[:-CRC_BYTES] for piece in sound.split(b"\x00") if piece]
            answer = b"".join(altered(content, answer) for content in contents)
        self.server.receive(answer, self.now_s)


@settings(max_examples=50)
@given(sound=st.integers(0, 40), answers=st.lists(ANSWERS, min_size=1, max_size=30))
def test_any_bytes_and_any_sound_frames_end_no_server_and_make_nothing_beyond_the_bounds(
    tmp_path_factory: pytest.TempPathFactory, sound: int, answers: list[list[tuple[float, int]] | bytes]
) -> None:
    folder = tmp_path_factory.mktemp("log")
    log = SweepLog(folder / "u1.sqlite", Retention())
    try:
        desk = Desk(folder, log)
        for answer in ([[]] * sound) + answers:
            desk.step(answer)
            desk.unit.ring.clear()
            desk.unit.make_sweep(desk.now_s)
        for _ in range(12):  # over a second, so that a status is due
            desk.step([])
    finally:
        log.close()
    for status in desk.told:
        bounds.check(status)
    for record in desk.published:
        bounds.check(Sweep.FromString(record))
    assert desk.told


def test_a_command_that_comes_when_the_server_has_ended_is_answered(tmp_path: Path) -> None:
    log = SweepLog(tmp_path / "u1.sqlite", Retention())
    try:
        server = Desk(tmp_path, log).server
        server.start()
        server.stop()
        server.join(time.monotonic() + 60.0)
        reply = server.command("stop", CommandRequest(request_id="1")).result(timeout=60.0)
    finally:
        log.close()
    assert (reply.done, reply.error) == (False, "the gateway that served it was stopped")
