"""What a gateway knows of a unit's health, over restarts, full disks and the commands of people."""

import json
import math
import time
from pathlib import Path

import pytest
import zenoh
from gateway.model_unit import ModelUnit
from gateway.serving import FIXED, SITE, connected, running, site_file
from gateway.tcp_unit import tcp_unit
from system.processes import PATIENCE_S, wait_until

from noctule import messages_pb2 as messages
from noctule.client import Client
from noctule.faults import sentence
from noctule.messages_pb2 import CommandRequest, Sweep
from noctule.site import Unit, load
from noctule_gateway.errors import CommandError
from noctule_gateway.health import judge as judging
from noctule_gateway.health import memory_file
from noctule_gateway.health.judge import Memory
from noctule_gateway.unit.sweep_health import SweepHealth

WELL = {
    "version": 2,
    "place": [],
    "bearing_rad": [0.1],
    "skipped": 0,
    "air_measured": True,
    "rows": [[1.5], [None]],
    "usual": [-2.5],
}
FOUND = [int(messages.FAULT_KIND_TURNED), 5, "e1", 0.5, "turned", 0]


def memory(**other: object) -> str:
    return memory_file.sealed(json.dumps({**WELL, "findings": [FOUND], **other}))


def found(number: int, value: object) -> str:
    """A memory in which that part of the finding is another."""
    return memory(findings=[[*FOUND[:number], value, *FOUND[number + 1 :]]])


def test_a_file_that_is_a_memory_is_read(tmp_path: Path) -> None:
    (tmp_path / "u1.health").write_text(memory())
    (fault,) = SweepHealth(unit(tmp_path), "attic", tmp_path / "u1.sqlite").faults("e1")
    assert (fault.kind, fault.since.ToNanoseconds(), fault.confidence) == (messages.FAULT_KIND_TURNED, 5, 0.5)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        json.dumps({**WELL, "findings": [FOUND]}),
        memory().replace("turned", "burned"),
        memory()[:-5],
        *map(memory_file.sealed, ("", "{}", "[1]", "1", '{"version": 2}')),
        memory(version=1),
        memory(bearing_rad=[]),
        memory(bearing_rad=["0.1"]),
        memory(rows=[[math.inf]]),
        memory(rows=[["1.5"]]),
        memory(rows=[[10**400]]),
        memory(skipped=10**400),
        memory(usual=[math.nan]),
        memory(place="abc"),
        memory(findings=[[]]),
        memory(findings=[FOUND[:3]]),
        memory(findings=[[[]]]),
        memory(findings=5),
        *(found(1, value) for value in ("x", 1.5, -1, 10**400, 10**19, None)),
        found(2, 5),
        *(found(3, value) for value in ("0.5", 1.5, -0.1, math.nan, 10**400, None)),
        found(4, 5),
        found(5, "x"),
    ],
)
def test_a_file_that_is_no_memory_is_replaced(tmp_path: Path, text: str, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "u1.health").write_text(text)
    with pytest.raises(ValueError):
        memory_file.read(tmp_path / "u1.health")
    health = SweepHealth(unit(tmp_path), "attic", tmp_path / "u1.sqlite")
    assert health.faults("e1") == []
    assert "can't be read; the gateway learns again what the unit hears" in caplog.text


def test_where_there_is_no_file_nothing_is_known(tmp_path: Path) -> None:
    assert len(memory_file.read(tmp_path / "u1.health").past) == len(Memory().past) == 0


def test_a_sweep_that_comes_again_is_judged_as_it_was_and_counts_once(tmp_path: Path) -> None:
    health = SweepHealth(unit(tmp_path), "attic", tmp_path / "u1.sqlite")
    for sequence in (1, 2, 2, 2, 3, 3, 4):
        message = Sweep(unit="u1", boot=1, sequence=sequence, readings=[no_sensor(n) for n in range(13)])
        health.judge(message, bytes([sequence]))
        assert list(message.faults) == ([messages.FAULT_KIND_NO_SENSOR] if sequence >= 2 else [])
        assert message.suspect_before == (2 if sequence == 2 else 0)
    assert health.flagged == 3
    (fault,) = health.faults("")
    assert fault.kind == messages.FAULT_KIND_NO_SENSOR


def test_a_memory_that_could_not_be_written_is_written_with_the_next_sweep(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    health = SweepHealth(unit(tmp_path), "attic", tmp_path / "u1.sqlite")
    (tmp_path / "u1.health-new").mkdir()  # in its way
    for sequence in range(2):
        health.judge(Sweep(sequence=sequence, readings=[no_sensor(n) for n in range(13)]), bytes([sequence]))
    first = health.memory()
    assert first is not None
    health.save(first)
    assert "the health file can't be written; after a restart the gateway learns again" in caplog.text
    (tmp_path / "u1.health-new").rmdir()
    second = health.memory()
    assert second is not None and second == first
    health.save(second)
    assert health.memory() is None
    assert [one.kind for one in memory_file.read(tmp_path / "u1.health").findings] == [messages.FAULT_KIND_NO_SENSOR]


def test_since_when_is_left_open_where_the_clock_has_been_set_since(tmp_path: Path) -> None:
    health = SweepHealth(unit(tmp_path), "attic", tmp_path / "u1.sqlite")
    for sequence in range(2):
        readings = [no_sensor(n) for n in range(13)]
        health.judge(Sweep(sequence=sequence, clock_epoch="e1", readings=readings), bytes([sequence]))
    (before,), (after,) = health.faults("e1"), health.faults("e2")
    assert before.HasField("since") and "(since 1970-01-01 00:00 UTC, " in sentence(before)
    assert not after.HasField("since") and "(since before the clock was set, " in sentence(after)


def test_a_room_that_was_changed_is_accepted_by_a_command_and_stays_so_over_a_restart(
    tmp_path: Path, router: zenoh.Session
) -> None:
    (tmp_path / "u1.health").write_text(
        memory(findings=[FOUND, [int(messages.FAULT_KIND_REPEATS), 5, "e1", 0.5, "x", 0]])
    )
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected")
            before = client.command("u1", "status", CommandRequest(), timeout_s=PATIENCE_S)
            reply = client.command("u1", "accept_room", CommandRequest(), timeout_s=PATIENCE_S)
            kept = memory_file.read(tmp_path / "u1.health")
    assert [one.kind for one in before.status.faults] == [messages.FAULT_KIND_REPEATS, messages.FAULT_KIND_TURNED]
    assert reply.done and [one.kind for one in reply.status.faults] == [messages.FAULT_KIND_REPEATS]
    assert len(kept.past) == 0 and [one.kind for one in kept.findings] == [messages.FAULT_KIND_REPEATS]
    given, done = [json.loads(line) for line in (tmp_path / "audit-1.jsonl").read_text().splitlines()[1:]]
    assert [(each["event"], each["command"]) for each in (given, done)] == [
        ("given", "accept_room"),
        ("done", "accept_room"),
    ]


def test_a_room_that_the_disk_does_not_keep_as_accepted_is_told_as_an_error(
    tmp_path: Path, router: zenoh.Session
) -> None:
    (tmp_path / "u1.health").write_text(memory(findings=[FOUND]))
    (tmp_path / "u1.health-new").mkdir()  # in its way
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected")
            refused = client.command("u1", "accept_room", CommandRequest(), timeout_s=PATIENCE_S)
            (tmp_path / "u1.health-new").rmdir()
            kept = client.command("u1", "accept_room", CommandRequest(), timeout_s=PATIENCE_S)
    assert not refused.done and "accepted, but the disk does not take that" in refused.error
    assert kept.done and memory_file.read(tmp_path / "u1.health").findings == ()


def test_the_room_of_a_carried_unit_is_not_to_be_accepted(tmp_path: Path) -> None:
    carried = load(site_file(tmp_path, ("u1", 1, "socket://127.0.0.1:1", 'pose = "key"'))).unit("u1")
    with pytest.raises(CommandError, match="the unit is carried"):
        SweepHealth(carried, "attic", tmp_path / "u1.sqlite").accept_room()


def test_a_judge_that_fails_keeps_no_sweep_from_the_log_and_is_told_once(
    tmp_path: Path, router: zenoh.Session, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fails(*_: object) -> None:
        raise IndexError("a detector")

    monkeypatch.setattr(judging.silence, "suspicions", fails)
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        got: list[Sweep] = []
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            client.on_sweep(got.append)
            wait_until(lambda: connected(client), "the unit was not connected")
            with line.lock:
                for _ in range(2):
                    line.unit.make_sweep(time.monotonic())
            wait_until(lambda: len(got) == 2, "no sweep was committed")
            wait_until(lambda: not line.unit.ring, "no sweep was acknowledged")
    assert caplog.text.count("u1: a sweep could not be judged; it is kept unjudged") == 1


def no_sensor(number: int) -> messages.Reading:
    return messages.Reading(bearing_rad=0.1 * number, status=messages.READING_STATUS_NO_SENSOR)


def unit(folder: Path) -> Unit:
    return load(site_file(folder, ("u1", 1, "socket://127.0.0.1:1", FIXED))).unit("u1")
