"""The gateway whole: model units over TCP on one side, a real Zenoh router and client on the other."""

import json
import math
import os
import shutil
import signal
import time
from importlib.metadata import version
from pathlib import Path

import pytest
import zenoh
from gateway.model_unit import ModelUnit
from gateway.serving import FIXED, RPC_ANY, SITE, connected, running, site_file, unit_status
from gateway.tcp_unit import tcp_unit
from system.processes import PATIENCE_S, free_ports, programs, wait_until

from noctule import bus, keys
from noctule.client import Client
from noctule.folder_lock import FILE_NAME
from noctule.messages_pb2 import (
    Calibration,
    CommandReply,
    CommandRequest,
    LogRecords,
    Pose,
    ServiceStatus,
    Sweep,
    SweepPlan,
    UnitStatus,
)
from noctule.site import load
from noctule_gateway.clock.regression import MOST_DRIFT
from noctule_gateway.service import Gateway
from noctule_gateway.wire import frames


def test_a_sweep_comes_to_the_bus_in_si_units_with_its_time_and_pose(tmp_path: Path, router: zenoh.Session) -> None:
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(
            tmp_path, ("u1", 7, line.address, FIXED + "\nsensor = { range_bias_m = 0.0023, face_offset_m = 0.018 }")
        )
        got: list[Sweep] = []
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            client.on_sweep(got.append)
            wait_until(lambda: connected(client), "the unit was not connected")
            assert client.units() == {"u1"}
            assert unit_status(client, "u1").gateway_version == version("noctule-gateway")
            with line.lock:
                before_s = time.time()
                made = line.unit.make_sweep(time.monotonic())
                after_s = time.time()
            (sweep,) = wait_until(lambda: got, "no sweep came")
            wait_until(lambda: unit_status(client, "u1").HasField("last_sweep"), "its status knows no sweep")
            logged_at_s = unit_status(client, "u1").last_sweep.ToNanoseconds() / 1e9
    assert before_s <= logged_at_s + 0.01 <= time.time() + 0.02
    assert (sweep.site, sweep.unit, sweep.boot, sweep.sequence, sweep.log_sequence) == (SITE, "u1", 1, 1, 1)
    allowed_s = 3 * sweep.clock_error_s + 0.01
    assert before_s - allowed_s <= sweep.start.ToNanoseconds() / 1e9 <= after_s + allowed_s
    assert (sweep.pose.x_m, sweep.pose.y_m, sweep.pose.heading_rad) == (1.0, 2.0, pytest.approx(math.pi / 2))
    assert sweep.air_temperature_c == 21.5
    assert (sweep.sensor.range_bias_m, sweep.sensor.face_offset_m) == (0.0023, 0.018)
    assert not sweep.sensor.HasField("range_sigma_m")
    assert not sweep.HasField("waypoint")
    heard, unheard = sweep.readings
    assert heard.bearing_rad == pytest.approx(math.radians(-135))
    assert abs(sweep.clock_drift) < 0.001  # the model's ticks are the host's own
    assert heard.time_of_flight_s == pytest.approx(made.readings[0].echo / 4e6 / (1 + sweep.clock_drift))
    assert (unheard.status, unheard.HasField("time_of_flight_s")) == (2, False)
    # 15000 times 4 us, by the best estimate of the oscillator so far: test_clock_truth.py has how good that is
    assert unheard.time_offset_s == pytest.approx(0.06, rel=1.1 * MOST_DRIFT)


def test_a_fixed_unit_is_given_the_fine_plan_and_a_tracked_one_keeps_its_own(
    tmp_path: Path, router: zenoh.Session
) -> None:
    born_s = time.monotonic()
    with tcp_unit(ModelUnit(7, born_s=born_s)) as fixed, tcp_unit(ModelUnit(8, born_s=born_s)) as tracked:
        path = site_file(tmp_path, ("u1", 7, fixed.address, FIXED), ("u2", 8, tracked.address, 'pose = "key"'))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client, "u1") and connected(client, "u2"), "not all are connected")
            wait_until(lambda: fixed.unit.plan.count == 61, "the fixed unit has no fine plan")

            def settings(unit: str) -> SweepPlan:
                return client.command(
                    unit, "settings", CommandRequest(request_id=unit), timeout_s=PATIENCE_S
                ).settings.plan

            assert (settings("u1").count, settings("u2").count) == (61, 13)


def test_commands_reach_the_unit_once_per_request_id(tmp_path: Path, router: zenoh.Session) -> None:
    unit = ModelUnit(7, born_s=time.monotonic())
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected")

            def command(name: str, request: CommandRequest) -> CommandReply:
                return client.command("u1", name, request, timeout_s=PATIENCE_S)

            plan = SweepPlan(bearing_step_rad=math.radians(45), count=7)
            replies = [
                command("configure", CommandRequest(request_id="a", plan=plan)),
                command("set_waypoint", CommandRequest(request_id="b", waypoint=3)),
                command("single", CommandRequest(request_id="c")),
                command("single", CommandRequest(request_id="c")),
            ]
            assert all(reply.done for reply in replies), replies
            refused = command("configure", CommandRequest(request_id="d", plan=SweepPlan(count=65)))
            assert (refused.done, "out of range" in refused.error) == (False, True)
            calibration = Calibration(backlash_half_steps=5, home=Calibration.HOME_STOP)
            assert command("calibrate", CommandRequest(request_id="g", calibration=calibration)).done
            assert command("trim_temperature", CommandRequest(request_id="h", temperature_c=20.5)).done
            known = command("settings", CommandRequest(request_id="i")).settings
            assert (known.plan.count, known.plan.bearing_step_rad) == (7, pytest.approx(math.radians(45)))
            assert (known.calibration.backlash_half_steps, known.calibration.home) == (5, Calibration.HOME_STOP)
            assert known.calibration.half_steps_per_turn == pytest.approx(4075.77, abs=0.005)
            assert known.temperature_trim_k == pytest.approx(20.5 - 31.5)  # the model's chip is at 31.5
            assert not known.stored
            hello = command("hello", CommandRequest(request_id="e"))
            assert (hello.done, hello.status.serial, hello.status.firmware) == (True, 7, "0.1.0")
            assert "no command 'jump'" in command("jump", CommandRequest(request_id="f")).error

            def audited() -> list[dict]:
                return [json.loads(line) for line in (tmp_path / "audit-1.jsonl").read_text().splitlines()[1:]]

            # An outcome is recorded beside the reply, not before it.
            wait_until(lambda: len(audited()) == 14, "not all is recorded")
            recorded = audited()
            assert {each["who"] for each in recorded if each["event"] == "given"} == {f"session {router.zid()}"}
            assert [(each["event"], each["command"], each["request_id"]) for each in recorded] == [
                (event, name, request)
                for name, request, outcome in (
                    ("configure", "a", "done"),
                    ("set_waypoint", "b", "done"),
                    ("single", "c", "done"),  # the second one was the same
                    ("configure", "d", "failed"),
                    ("calibrate", "g", "done"),
                    ("trim_temperature", "h", "done"),
                    ("jump", "f", "failed"),  # the others only ask
                )
                for event in ("given", outcome)
            ]
    _, configure, waypoint, single, *_ = unit.carried_out  # first the plan that every fixed unit gets
    assert isinstance(configure, frames.Configure)
    assert (configure.first_bearing, configure.bearing_step, configure.count) == (-24576, 8192, 7)
    assert (waypoint, single) == (frames.SetWaypoint(0, 3), frames.Single(0))


@pytest.mark.parametrize("several", [keys.rpc(SITE, keys.ANY, "home"), keys.rpc(keys.ANY, "u1", "home"), RPC_ANY])
def test_a_command_with_a_wildcard_is_refused_and_no_unit_obeys(
    several: str, tmp_path: Path, router: zenoh.Session
) -> None:
    unit = ModelUnit(7, born_s=time.monotonic())
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected")
            request = CommandRequest(request_id="several").SerializeToString()
            (refusal,) = router.get(several, payload=request)
            assert refusal.err is not None and b"can't be part of a key" in refusal.err.payload.to_bytes()
            assert client.command("u1", "single", CommandRequest(), timeout_s=PATIENCE_S).done
    (recorded,) = [json.loads(line) for line in (tmp_path / "refused-1.jsonl").read_text().splitlines()[1:]]
    assert (recorded["event"], recorded["unit"], recorded["request_id"]) == ("refused", "u1", "several")
    assert (recorded["who"], recorded["signed"]) == ("session ?", False)  # nothing was attached
    assert "can't be part of a key" in recorded["error"]
    _, single = unit.carried_out  # first the plan that every fixed unit gets
    assert single == frames.Single(0)


def test_a_unit_in_its_loader_is_shown_and_served_again_when_its_firmware_runs(
    tmp_path: Path, router: zenoh.Session, caplog: pytest.LogCaptureFixture
) -> None:
    unit = ModelUnit(7, born_s=time.monotonic())
    unit.in_loader = frames.Stay.NO_APPLICATION
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: unit_status(client).state == UnitStatus.STATE_LOADER, "the loader was not shown")
            assert "no sound firmware" in unit_status(client).detail
            refused = client.command("u1", "settings", CommandRequest(request_id="a"), timeout_s=PATIENCE_S)
            assert "not connected" in refused.error
            with line.lock:
                unit.in_loader = None
                unit.reset(time.monotonic(), cause=0x08)  # WDTRSF: datasheet C8051F34x, chapter 11
            wait_until(lambda: connected(client), "the unit was not connected")
            assert "watchdog" in unit_status(client).reset_cause
    assert "u1 has restarted: watchdog reset: the firmware hung" in caplog.text


def test_the_log_answers_from_and_max_and_says_what_it_can_not_read(tmp_path: Path, router: zenoh.Session) -> None:
    unit = ModelUnit(7, born_s=time.monotonic())
    for _ in range(10):
        unit.make_sweep(time.monotonic())
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: unit_status(client).log_head == 10, "the sweeps were not logged")
            records = client.log("u1", 4, max=3)
            assert isinstance(records, LogRecords)
            assert [sweep.sequence for sweep in records.sweeps] == [4, 5, 6]
            assert (records.head, records.tail, records.log_id) == (10, 1, unit_status(client).log_id)
            for wrong in ("x", "9" * 20):
                (reply,) = router.get(f"{keys.log(SITE, 'u1')}?from={wrong}")
                assert reply.err is not None
                assert f"from={wrong}" in reply.err.payload.to_bytes().decode()


def test_a_moving_unit_takes_its_pose_from_the_key_and_says_when_there_is_none(
    tmp_path: Path, router: zenoh.Session
) -> None:
    unit = ModelUnit(7, born_s=time.monotonic())
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, 'pose = "key"'))
        got: list[Sweep] = []
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            client.on_sweep(got.append)
            wait_until(lambda: connected(client), "the unit was not connected")
            with line.lock:
                unit.make_sweep(time.monotonic())
            wait_until(lambda: "no pose" in unit_status(client).detail, "the missing pose was not shown")
            client.publish_pose("u1", Pose(x_m=4.0))

            def placed() -> bool:
                with line.lock:
                    unit.make_sweep(time.monotonic())
                return any(sweep.HasField("pose") for sweep in got)

            wait_until(placed, "no sweep got the pose")
            wait_until(lambda: not unit_status(client).detail, "the trouble was not taken back")
        assert not got[0].HasField("pose")
        assert got[-1].pose.x_m == 4.0


def test_a_command_and_a_pose_with_fields_of_a_newer_version_are_taken_without_them_and_counted(
    tmp_path: Path, router: zenoh.Session
) -> None:
    newer = b"\xf8\x7f\x07"  # field 2047, a varint
    path = site_file(tmp_path, ("u1", 7, "socket://127.0.0.1:9", 'pose = "key"'))
    with running(path, tmp_path, router) as gateway:
        (reply,) = router.get(
            keys.rpc(SITE, "u1", "hello"), payload=CommandRequest(request_id="a").SerializeToString() + newer
        )
        assert reply.ok is not None and CommandReply.FromString(reply.ok.payload.to_bytes()).done
        router.put(keys.pose(SITE, "u1"), Pose(x_m=1).SerializeToString() + newer)

        def counted() -> int:
            gateway.report()
            return next(
                status.counters["messages_newer"] for status in gateway.statuses() if isinstance(status, ServiceStatus)
            )

        wait_until(lambda: counted() == 2, "they are not counted")


def test_a_stopped_gateway_leaves_its_units_as_disconnected(tmp_path: Path, router: zenoh.Session) -> None:
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        services: list[ServiceStatus] = []
        statuses: list[UnitStatus] = []
        with Client(SITE, session=router) as client:
            client.on_service_status(services.append)
            client.on_unit_status(statuses.append)
            with running(path, tmp_path, router):
                wait_until(lambda: connected(client), "the unit was not connected")
            wait_until(lambda: statuses and "stopped" in statuses[-1].detail, "the last status did not come")
        assert statuses[-1].state == UnitStatus.STATE_DISCONNECTED
        assert services[0].role == "gateway"


def test_killed_and_started_again_it_loses_no_sweep_and_doubles_none(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    unit = ModelUnit(7, born_s=time.monotonic(), sweep_s=0.02)
    with tcp_unit(unit) as line, programs(tmp_path) as started:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED + "\nsweep = { start = true }"))
        command = ("noctule-gateway", "run", str(path), "--data", str(tmp_path / "data"))
        listen = ("--listen", f"tcp/127.0.0.1:{port}")
        for round_ in range(3):
            started.start("gateway", *command, *listen)
            acknowledged = 100 * (round_ + 1)
            wait_until(lambda least=acknowledged: len(unit.made) - len(unit.ring) >= least, "the sweeps do not go on")
            started.kill("gateway")
        started.start("gateway", *command, *listen)
        with Client(SITE, connect=[f"tcp/127.0.0.1:{port}"]) as client:
            wait_until(lambda: connected(client), "the unit was not connected")
            client.command("u1", "stop", CommandRequest(request_id="last"), timeout_s=PATIENCE_S)
            wait_until(lambda: not unit.ring, "the ring was not emptied")
            wait_until(lambda: unit_status(client).log_head >= len(unit.made), "the log is short")
            held = held_sweeps(client)
        assert started.end("gateway") == 0
    assert [sweep.log_sequence for sweep in held] == list(range(1, len(held) + 1))
    assert sorted((sweep.boot, sweep.sequence) for sweep in held) == [(made.boot, made.sequence) for made in unit.made]


def held_sweeps(client: Client) -> list[Sweep]:
    held: list[Sweep] = []
    while (records := client.log("u1", len(held) + 1)) and records.sweeps:
        held += records.sweeps
    return held


def test_units_are_served_before_any_router_answers(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    unit = ModelUnit(7, born_s=time.monotonic())
    unit.make_sweep(time.monotonic())
    with tcp_unit(unit) as line, programs(tmp_path) as started:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        endpoint = f"tcp/127.0.0.1:{port}"
        started.start("gateway", "noctule-gateway", "run", str(path), "--data", str(tmp_path), "--connect", endpoint)
        wait_until(lambda: not unit.ring, "the sweep was not acknowledged")
        with bus.open_session(listen=[endpoint]) as router, Client(SITE, session=router) as client:
            wait_until(lambda: unit_status(client).log_head == 1, "the unit did not come to the bus")
            assert started.end("gateway") == 0
        assert started.log("gateway").endswith(" stopped\n")  # all is closed, whatever status Python's end may give


def test_a_gateway_says_as_long_as_no_router_has_answered(tmp_path: Path, router: zenoh.Session) -> None:
    gateway = Gateway(load(site_file(tmp_path, ("u1", 7, "socket://127.0.0.1:9", FIXED))), tmp_path)
    try:
        gateway.start()
        gateway.report()
        assert "not on the bus yet: no router has answered" in gateway.summary
        gateway.join(router)
        gateway.report()
        assert "not on the bus" not in gateway.summary
    finally:
        gateway.close()


def test_a_gateway_that_can_not_begin_says_why_and_ends(tmp_path: Path) -> None:
    with programs(tmp_path) as started:
        started.start("gateway", "noctule-gateway", "run", str(tmp_path / "none.toml"), "--data", str(tmp_path))
        wait_until(lambda: "none.toml can't be read" in started.log("gateway"), "no reason was given")


@pytest.mark.parametrize("stop", [signal.SIGKILL, signal.SIGSTOP])
def test_the_ghosts_of_a_gateway_that_is_killed_or_hangs_are_gone_within_the_lease(
    tmp_path: Path, stop: signal.Signals
) -> None:
    lease_s = 2.0
    config = tmp_path / "zenoh.json5"
    config.write_text(f"{{ transport: {{ link: {{ tx: {{ lease: {1000 * lease_s:.0f} }} }} }} }}")
    (port,) = free_ports(1)
    endpoint = f"tcp/127.0.0.1:{port}"
    path = site_file(tmp_path, ("u1", 7, "socket://127.0.0.1:9", FIXED))
    with (
        bus.open_session(listen=[endpoint]) as router,
        Client(SITE, session=router) as client,
        programs(tmp_path) as started,
    ):
        command = ("noctule-gateway", "run", str(path), "--data", str(tmp_path / "data"), "--connect", endpoint)
        started.start("gateway", *command, env={bus.CONFIG_VARIABLE: str(config)})
        wait_until(lambda: client.units() and client.unit_statuses(), "the unit did not come")
        os.kill(started.pid("gateway"), stop)
        # Zenoh's own lease is 10 s; a busy machine may take note of the end of this one late.
        wait_until(lambda: not client.units(), "the unit is still shown", lease_s + 5.0)
        assert client.unit_statuses() == []


def test_a_waypoint_that_is_not_of_the_units_path_is_refused_in_words(tmp_path: Path, router: zenoh.Session) -> None:
    two = "path = { waypoints = [[0, 0, 0], [1, 0, 0]] }"
    path = site_file(tmp_path, ("u1", 7, "socket://127.0.0.1:9", two))
    with running(path, tmp_path, router), Client(SITE, session=router) as client:
        reply = client.command("u1", "set_waypoint", CommandRequest(waypoint=2), timeout_s=PATIENCE_S)
    assert (reply.done, reply.error) == (False, "out of range: waypoint is 2: give 0 to 1")


def test_sweeps_of_a_unit_whose_log_was_deleted_wait_in_it_until_they_are_in_a_new_one(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    unit = ModelUnit(7, born_s=time.monotonic())
    data = tmp_path / "data"
    with tcp_unit(unit) as line, programs(tmp_path) as started:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        endpoint = f"tcp/127.0.0.1:{port}"
        started.start("gateway", "noctule-gateway", "run", str(path), "--data", str(data), "--listen", endpoint)
        with Client(SITE, connect=[endpoint]) as client:
            wait_until(lambda: connected(client), "the unit was not connected")
            with line.lock:
                unit.make_sweep(time.monotonic())
            wait_until(lambda: not unit.ring, "the sweep was not acknowledged")
            shutil.rmtree(data)
            with line.lock:
                lost = unit.make_sweep(time.monotonic())
            wait_until(lambda: "see that the folder is there" in unit_status(client).detail, "it is not told")
            assert unit.ring
            data.mkdir()
            wait_until(lambda: not unit.ring, "the sweep was not logged in the end")
            (held,) = held_sweeps(client)
            assert held.sequence == lost.sequence
            wait_until(lambda: (data / FILE_NAME).exists(), "the new folder is not held")
        wait_until(lambda: "was moved, deleted or replaced" in started.log("gateway"), "that is not in its log")
        assert started.end("gateway") == 0
