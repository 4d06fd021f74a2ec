"""The gateway whole: model units over TCP on one side, a real Zenoh router and client on the other."""

import contextlib
import json
import math
import os
import shutil
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

import pytest
import zenoh
from gateway.model_unit import ModelUnit
from gateway.rfc2217_server import server
from gateway.tcp_unit import tcp_unit
from google.protobuf.timestamp_pb2 import Timestamp
from system.processes import free_ports, programs, wait_until

from noctule import bus, elapsed, keys
from noctule.client import Client
from noctule.elapsed import Instant
from noctule.folder_lock import FILE_NAME
from noctule.kernel_clock import KernelClock
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
from noctule_gateway.service import Gateway
from noctule_gateway.wire import frames

SITE = "test-site"
UNIT = """
[[unit]]
name = "{name}"
serial = {serial}
address = "{address}"
{more}
"""
RPC_ANY = keys.rpc(SITE, "u1", keys.ANY)
FIXED = "pose = { x_m = 1.0, y_m = 2.0, heading_deg = 90 }"


def site_file(folder: Path, *units: tuple[str, int, str, str], top: str = "air_temperature_c = 21.5") -> Path:
    """A site file of units (name, serial, address, pose and whatever else)."""
    path = folder / "site.toml"
    tables = [
        UNIT.format(name=name, serial=serial, address=address, more=more) for name, serial, address, more in units
    ]
    path.write_text(f'site = "{SITE}"\n{top}\n' + "".join(tables))
    return path


@pytest.fixture
def router() -> Iterator[zenoh.Session]:
    (port,) = free_ports(1)
    with bus.open_session(listen=[f"tcp/127.0.0.1:{port}"]) as session:
        yield session


@contextmanager
def running(
    path: Path,
    data: Path,
    session: zenoh.Session,
    now: Callable[[], Instant] = elapsed.now,
    kernel_clock: Callable[[], KernelClock] = lambda: KernelClock(synchronised=True, most_error_s=0.01),
) -> Iterator[Gateway]:
    gateway = Gateway(load(path), data, now=now, kernel_clock=kernel_clock)
    try:
        gateway.start()
        gateway.join(session)
        gateway.report()
        yield gateway
    finally:
        gateway.close()


def unit_status(client: Client, unit: str = "u1") -> UnitStatus:
    return next((status for status in client.unit_statuses() if status.unit == unit), UnitStatus())


def connected(client: Client, unit: str = "u1") -> bool:
    away = (UnitStatus.STATE_UNSPECIFIED, UnitStatus.STATE_DISCONNECTED, UnitStatus.STATE_LOADER)
    return unit_status(client, unit).state not in away


def test_a_sweep_comes_to_the_bus_in_si_units_with_its_time_and_pose(tmp_path: Path, router: zenoh.Session) -> None:
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(
            tmp_path, ("u1", 7, line.address, FIXED + "\nsensor = { range_bias_m = 0.0023, face_offset_m = 0.018 }")
        )
        got: list[Sweep] = []
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            client.on_sweep(got.append)
            wait_until(lambda: connected(client), "the unit was not connected", 20)
            assert client.units() == {"u1"}
            assert unit_status(client, "u1").gateway_version == version("noctule-gateway")
            with line.lock:
                made = line.unit.make_sweep(time.monotonic())
                made_at_s = time.time()
            (sweep,) = wait_until(lambda: got, "no sweep came", 20)
    assert (sweep.site, sweep.unit, sweep.boot, sweep.sequence, sweep.log_sequence) == (SITE, "u1", 1, 1, 1)
    assert sweep.start.ToNanoseconds() / 1e9 == pytest.approx(made_at_s, abs=3 * sweep.clock_error_s + 0.01)
    assert (sweep.pose.x_m, sweep.pose.y_m, sweep.pose.heading_rad) == (1.0, 2.0, pytest.approx(math.pi / 2))
    assert sweep.air_temperature_c == 21.5
    assert (sweep.sensor.range_bias_m, sweep.sensor.face_offset_m) == (0.0023, 0.018)
    assert not sweep.sensor.HasField("range_sigma_m")
    assert not sweep.HasField("waypoint")
    heard, unheard = sweep.readings
    assert heard.bearing_rad == pytest.approx(math.radians(-135))
    assert abs(sweep.clock_drift) < 0.001  # the model's ticks are the host's own
    second = 1 + sweep.clock_drift
    assert heard.time_of_flight_s == pytest.approx(made.readings[0].echo / 4e6 / second)
    assert (unheard.status, unheard.HasField("time_of_flight_s")) == (2, False)
    assert unheard.time_offset_s == pytest.approx(0.06 / second)  # 15000 times 4 us


def test_an_oscillator_that_is_one_percent_fast_is_taken_out_of_a_sweeps_times(
    tmp_path: Path, router: zenoh.Session
) -> None:
    unit = ModelUnit(7, born_s=time.monotonic(), drift=0.01)
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        got: list[Sweep] = []
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            client.on_sweep(got.append)
            wait_until(lambda: connected(client), "the unit was not connected", 20)

            def corrected() -> bool:
                with line.lock:
                    unit.make_sweep(time.monotonic())
                return any(sweep.HasField("clock_drift") for sweep in got)

            wait_until(corrected, "the drift did not become known", 60)
    sweep = next(sweep for sweep in got if sweep.HasField("clock_drift"))
    made = unit.made[sweep.sequence - 1]
    # Three standard deviations of what the gateway asks of a drift: 200 ppm.
    assert sweep.readings[0].time_of_flight_s == pytest.approx(made.readings[0].echo / 4e6 / 1.01, rel=6e-4)


def test_a_wrong_unit_is_shown_and_nothing_of_it_is_taken(tmp_path: Path, router: zenoh.Session) -> None:
    unit = ModelUnit(8, born_s=time.monotonic())
    unit.make_sweep(time.monotonic())
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: "unit 8 answers" in unit_status(client).detail, "the wrong unit was not shown", 20)
            status = unit_status(client)
        assert status.state == UnitStatus.STATE_DISCONNECTED
        assert status.log_head == 0
        assert len(unit.ring) == 1


@contextmanager
def wrong_device(answer: Callable[[bytes], bytes]) -> Iterator[str]:
    """The address of a device that is no unit: it answers each piece that it gets."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve() -> None:
            with contextlib.suppress(OSError):  # shut down below
                while True:
                    connection, _ = listening.accept()
                    with connection:
                        while piece := connection.recv(1000):
                            connection.sendall(answer(piece))

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield f"socket://127.0.0.1:{listening.getsockname()[1]}"
        finally:
            listening.shutdown(socket.SHUT_RDWR)
            thread.join()


def test_no_answer_and_what_can_not_be_read_and_a_line_that_sends_all_back_are_three_things(
    tmp_path: Path, router: zenoh.Session, caplog: pytest.LogCaptureFixture
) -> None:
    with (
        wrong_device(lambda _: b"") as silent,
        wrong_device(lambda piece: bytes(0x80 | byte for byte in piece)) as garbled,
        wrong_device(lambda piece: piece) as looped,
    ):
        told = {
            "u1": f"no answer on {silent}",
            "u2": f"what comes on {garbled} can't be read: another device, or another baud rate?",
            "u3": f"no answer on {looped}, though frames come: check the wire to the unit, and whether the line sends "
            "back what it is sent",
        }
        units = [
            (name, 7 + n, each, FIXED)
            for n, (name, each) in enumerate(zip(told, (silent, garbled, looped), strict=True))
        ]
        with running(site_file(tmp_path, *units), tmp_path, router), Client(SITE, session=router) as client:
            for name, detail in told.items():
                wait_until(lambda: unit_status(client, name).detail == detail, f"{name} is not told", 20)  # noqa: B023
    for name, detail in told.items():
        assert f"{name}: {detail}" in caplog.text


def test_a_connection_that_has_gone_mute_is_opened_again_though_it_was_never_closed(
    tmp_path: Path, router: zenoh.Session
) -> None:
    """As behind a terminal server that holds on to a connection of before its restart of the serial side."""
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected", 20)
            line.mute()
            wait_until(lambda: not connected(client), "its silence was not seen", 20)
            wait_until(lambda: connected(client), "the mute connection was kept", 30)
            assert line.connections == 2


def test_a_unit_that_is_not_there_is_shown_and_served_as_soon_as_it_is(tmp_path: Path, router: zenoh.Session) -> None:
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        (closed_port,) = free_ports(1)
        path = site_file(
            tmp_path,
            ("u1", 7, line.address, FIXED),
            ("u2", 8, f"socket://127.0.0.1:{closed_port}", FIXED),
        )
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected", 20)
            line.cut()
            wait_until(lambda: line.connections == 2, "the line was not opened again", 20)
            wait_until(lambda: connected(client), "the unit was not connected again", 20)
            assert unit_status(client, "u2").state == UnitStatus.STATE_DISCONNECTED
            assert "can't open" in unit_status(client, "u2").detail


def test_a_fixed_unit_is_given_the_fine_plan_and_a_tracked_one_keeps_its_own(
    tmp_path: Path, router: zenoh.Session
) -> None:
    born_s = time.monotonic()
    with tcp_unit(ModelUnit(7, born_s=born_s)) as fixed, tcp_unit(ModelUnit(8, born_s=born_s)) as tracked:
        path = site_file(tmp_path, ("u1", 7, fixed.address, FIXED), ("u2", 8, tracked.address, 'pose = "key"'))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client, "u1") and connected(client, "u2"), "not all are connected", 20)
            wait_until(lambda: fixed.unit.plan.count == 61, "the fixed unit has no fine plan", 20)

            def settings(unit: str) -> SweepPlan:
                return client.command(unit, "settings", CommandRequest(request_id=unit), timeout_s=10).settings.plan

            assert (settings("u1").count, settings("u2").count) == (61, 13)


def test_commands_reach_the_unit_once_per_request_id(tmp_path: Path, router: zenoh.Session) -> None:
    unit = ModelUnit(7, born_s=time.monotonic())
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected", 20)

            def command(name: str, request: CommandRequest) -> CommandReply:
                return client.command("u1", name, request, timeout_s=10)

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
            wait_until(lambda: len(audited()) == 14, "not all is recorded", within_s=10)
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
            wait_until(lambda: connected(client), "the unit was not connected", 20)
            request = CommandRequest(request_id="several").SerializeToString()
            (refusal,) = router.get(several, payload=request)
            assert refusal.err is not None and b"can't be part of a key" in refusal.err.payload.to_bytes()
            assert client.command("u1", "single", CommandRequest(), timeout_s=10).done
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
            wait_until(lambda: unit_status(client).state == UnitStatus.STATE_LOADER, "the loader was not shown", 20)
            assert "no sound firmware" in unit_status(client).detail
            refused = client.command("u1", "settings", CommandRequest(request_id="a"), timeout_s=10)
            assert "not connected" in refused.error
            with line.lock:
                unit.in_loader = None
                unit.reset(time.monotonic(), cause=0x08)  # WDTRSF: datasheet C8051F34x, chapter 11
            wait_until(lambda: connected(client), "the unit was not connected", 20)
            assert "watchdog" in unit_status(client).reset_cause
    assert "u1 has started anew: its watchdog has bitten" in caplog.text


def test_the_log_answers_from_and_max_and_says_what_it_can_not_read(tmp_path: Path, router: zenoh.Session) -> None:
    unit = ModelUnit(7, born_s=time.monotonic())
    for _ in range(10):
        unit.make_sweep(time.monotonic())
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: unit_status(client).log_head == 10, "the sweeps were not logged", 20)
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
            wait_until(lambda: connected(client), "the unit was not connected", 20)
            with line.lock:
                unit.make_sweep(time.monotonic())
            wait_until(lambda: "no pose" in unit_status(client).detail, "the missing pose was not shown", 20)
            client.publish_pose("u1", Pose(x_m=4.0))

            def placed() -> bool:
                with line.lock:
                    unit.make_sweep(time.monotonic())
                return any(sweep.HasField("pose") for sweep in got)

            wait_until(placed, "no sweep got the pose", 20)
            wait_until(lambda: not unit_status(client).detail, "the trouble was not taken back", 20)
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

        wait_until(lambda: counted() == 2, "they are not counted", 20)


def test_a_trackers_own_time_of_a_pose_counts_and_not_when_it_came(tmp_path: Path, router: zenoh.Session) -> None:
    unit = ModelUnit(7, born_s=time.monotonic())
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, 'pose = "key"'))
        got: list[Sweep] = []
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            client.on_sweep(got.append)
            wait_until(lambda: connected(client), "the unit was not connected", 20)
            now_s = int(time.time())
            client.publish_pose("u1", Pose(x_m=9.0, time=Timestamp(seconds=now_s + 3600)))  # of a clock that is wrong
            client.publish_pose("u1", Pose(x_m=0.0, time=Timestamp(seconds=now_s - 50)))
            client.publish_pose("u1", Pose(x_m=1e300, time=Timestamp(seconds=now_s + 10)))  # no place on Earth
            client.publish_pose("u1", Pose(x_m=200.0, time=Timestamp(seconds=now_s + 50)))

            def placed() -> bool:
                with line.lock:
                    unit.make_sweep(time.monotonic())
                return any(sweep.pose.x_m > 0 for sweep in got)

            wait_until(placed, "no sweep got a pose between the two", 20)  # one before the second pose came lies at 0
        assert got[-1].pose.x_m == pytest.approx(100.0, abs=60.0)  # half-way, and 2 m further each second


def test_a_stopped_gateway_leaves_its_units_as_disconnected(tmp_path: Path, router: zenoh.Session) -> None:
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        services: list[ServiceStatus] = []
        statuses: list[UnitStatus] = []
        with Client(SITE, session=router) as client:
            client.on_service_status(services.append)
            client.on_unit_status(statuses.append)
            with running(path, tmp_path, router):
                wait_until(lambda: connected(client), "the unit was not connected", 20)
            wait_until(lambda: statuses and "stopped" in statuses[-1].detail, "the last status did not come", 20)
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
            wait_until(
                lambda least=acknowledged: len(unit.made) - len(unit.ring) >= least, "the sweeps do not go on", 30
            )
            started.kill("gateway")
        started.start("gateway", *command, *listen)
        with Client(SITE, connect=[f"tcp/127.0.0.1:{port}"]) as client:
            wait_until(lambda: connected(client), "the unit was not connected", 30)
            client.command("u1", "stop", CommandRequest(request_id="last"), timeout_s=10)
            wait_until(lambda: not unit.ring, "the ring was not emptied", 30)
            wait_until(lambda: unit_status(client).log_head >= len(unit.made), "the log is short", 10)
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
        wait_until(lambda: not unit.ring, "the sweep was not acknowledged", 30)
        with bus.open_session(listen=[endpoint]) as router, Client(SITE, session=router) as client:
            wait_until(lambda: unit_status(client).log_head == 1, "the unit did not come to the bus", 30)
            assert started.end("gateway") == 0


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
        wait_until(lambda: "none.toml can't be read" in started.log("gateway"), "no reason was given", 30)


def test_a_status_says_since_when_a_unit_has_answered_and_since_when_it_has_not(
    tmp_path: Path, router: zenoh.Session
) -> None:
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        begun_s = time.time()
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected", 20)
            connected_s = time.time()
            up_s = unit_status(client).since.ToMilliseconds() / 1000
            assert begun_s - 0.001 <= up_s <= connected_s
            line.close()
            wait_until(lambda: not connected(client), "the unit is still shown", 20)
            down_s = unit_status(client).since.ToMilliseconds() / 1000
            assert connected_s - 0.001 <= down_s <= time.time()
            reported = unit_status(client).time
            wait_until(lambda: unit_status(client).time != reported, "no further status", 20)
            assert unit_status(client).since.ToMilliseconds() / 1000 == pytest.approx(down_s, abs=0.1)


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
        wait_until(lambda: client.units() and client.unit_statuses(), "the unit did not come", 30)
        os.kill(started.pid("gateway"), stop)
        wait_until(lambda: not client.units(), "the unit is still shown", lease_s + 1.0)
        assert client.unit_statuses() == []


def test_a_host_whose_clock_is_set_by_forty_days_keeps_its_sweeps_and_says_that_it_was_set(
    tmp_path: Path, router: zenoh.Session, caplog: pytest.LogCaptureFixture
) -> None:
    set_s = 0.0

    def now() -> Instant:
        true = elapsed.now()
        return Instant(true.utc_s + set_s, true.kernel_boot, true.since_boot_s)

    unit = ModelUnit(7, born_s=time.monotonic())
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router, now) as gateway, Client(SITE, session=router) as client:
            services: list[ServiceStatus] = []
            client.on_service_status(services.append)
            # The gateway of running() has reported once, with the clock as it was.
            for made, days in enumerate((-40, 0, 40), start=1):
                set_s = days * 86400.0
                with line.lock:
                    unit.make_sweep(time.monotonic())
                wait_until(
                    lambda most=made: unit_status(client).log_head == most and not unit.ring, "no sweep was logged", 20
                )
                gateway.report()
            wait_until(lambda: services and services[-1].counters["clock_sets"] == 3, "it was not counted", 20)
            assert (unit_status(client).log_tail, unit_status(client).log_removed) == (1, 0)
            records = client.log("u1", 1)
    sweeps = records.sweeps if records is not None else []
    assert [one.log_sequence for one in sweeps] == [1, 2, 3]
    assert len({one.clock_epoch for one in sweeps} - {""}) == 3
    assert "the host's clock was set forward by 3456000 s" in services[-1].detail
    assert caplog.text.count("the host's clock was set") == 3


@pytest.mark.parametrize("days", [-14, 14])
def test_a_unit_whose_pose_was_published_before_the_clock_was_set_keeps_it(
    tmp_path: Path, router: zenoh.Session, days: int
) -> None:
    set_s = 0.0

    def now() -> Instant:
        true = elapsed.now()
        return Instant(true.utc_s + set_s, true.kernel_boot, true.since_boot_s)

    unit, got = ModelUnit(7, born_s=time.monotonic()), list[Sweep]()
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, 'pose = "key"'))
        with running(path, tmp_path, router, now), Client(SITE, session=router) as client:
            client.on_sweep(got.append)
            wait_until(lambda: connected(client), "the unit was not connected", 20)
            client.publish_pose("u1", Pose(x_m=3.0))

            def placed() -> bool:
                with line.lock:
                    unit.make_sweep(time.monotonic())
                return any(sweep.HasField("pose") for sweep in got)

            wait_until(placed, "no sweep got the pose", 20)
            set_s, before = days * 86400.0, got[-1]
            with line.lock:
                unit.make_sweep(time.monotonic())
            wait_until(lambda: got[-1].clock_epoch != before.clock_epoch, "no sweep came after the set", 20)
    assert got[-1].pose.x_m == 3.0


@pytest.mark.parametrize("days", [-14, 14])
def test_a_log_of_before_the_clock_was_set_tells_no_time_of_after_it(
    tmp_path: Path, router: zenoh.Session, days: int
) -> None:
    """The clock is set while the gateway is down, and so is the unit reset: only the log knows the earlier boot."""
    set_s = days * 86400.0

    def now() -> Instant:
        true = elapsed.now()
        return Instant(true.utc_s + set_s, true.kernel_boot, true.since_boot_s)

    unit = ModelUnit(7, born_s=time.monotonic())
    with tcp_unit(unit) as line, Client(SITE, session=router) as client:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        for number in (1, 2):
            with line.lock:
                unit.make_sweep(time.monotonic())
                if number == 2:
                    unit.reset(time.monotonic())
            with running(path, tmp_path, router, now):
                wait_until(lambda: unit_status(client).log_head == number, "no sweep was logged", 20)  # noqa: B023
                records = client.log("u1", 1)
            set_s = 0.0
    assert records is not None
    before, after = records.sweeps
    assert (before.boot, after.boot) == (1, 1)
    assert before.clock_epoch != after.clock_epoch
    assert abs(before.start.ToNanoseconds() / 1e9 - days * 86400.0 - time.time()) < 60
    assert abs(after.start.ToNanoseconds() / 1e9 - time.time()) < after.clock_error_s


def test_a_host_whose_clock_nothing_synchronises_says_so(
    tmp_path: Path, router: zenoh.Session, caplog: pytest.LogCaptureFixture
) -> None:
    """16 s is what an unsynchronised kernel states: NTP_PHASE_LIMIT, linux/timex.h."""
    clock = KernelClock(synchronised=False, most_error_s=16.0)
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router, kernel_clock=lambda: clock) as gateway:

            def service() -> ServiceStatus:
                gateway.report()
                return next(status for status in gateway.statuses() if isinstance(status, ServiceStatus))

            assert "the host's clock: nothing synchronises it" in service().detail
            assert (service().counters["clock_unsynchronised"], service().counters["clock_error_ms"]) == (1, 16_000)
            clock = KernelClock(synchronised=True, most_error_s=0.002)
            assert "the host's clock" not in service().detail
            assert (service().counters["clock_unsynchronised"], service().counters["clock_error_ms"]) == (0, 2)
    assert caplog.text.count("nothing synchronises it") == 1


def test_sweeps_of_a_unit_whose_log_was_deleted_wait_in_it_until_they_are_in_a_new_one(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    unit = ModelUnit(7, born_s=time.monotonic())
    data = tmp_path / "data"
    with tcp_unit(unit) as line, programs(tmp_path) as started:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        endpoint = f"tcp/127.0.0.1:{port}"
        started.start("gateway", "noctule-gateway", "run", str(path), "--data", str(data), "--listen", endpoint)
        with Client(SITE, connect=[endpoint]) as client:
            wait_until(lambda: connected(client), "the unit was not connected", 30)
            with line.lock:
                unit.make_sweep(time.monotonic())
            wait_until(lambda: not unit.ring, "the sweep was not acknowledged", 20)
            shutil.rmtree(data)
            with line.lock:
                lost = unit.make_sweep(time.monotonic())
            wait_until(lambda: "see that the folder is there" in unit_status(client).detail, "it is not told", 20)
            assert unit.ring
            data.mkdir()
            wait_until(lambda: not unit.ring, "the sweep was not logged in the end", 20)
            (held,) = held_sweeps(client)
            assert held.sequence == lost.sequence
            wait_until(lambda: (data / FILE_NAME).exists(), "the new folder is not held", 20)
        assert "was moved, deleted or replaced" in started.log("gateway")
        assert started.end("gateway") == 0


def test_a_server_that_sends_no_rfc2217_is_its_units_trouble_and_the_other_units_are_served(tmp_path: Path) -> None:
    def send(connection: socket.socket) -> None:
        connection.sendall(bytes.fromhex("ff fa 2c 65 ff f0"))
        while connection.recv(1000):
            pass

    (port,) = free_ports(1)
    unit = ModelUnit(7, born_s=time.monotonic())
    with tcp_unit(unit) as line, server(send, timeout_s=0.3) as address, programs(tmp_path) as started:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED), ("u2", 8, address, FIXED))
        endpoint = f"tcp/127.0.0.1:{port}"
        started.start("gateway", "noctule-gateway", "run", str(path), "--data", str(tmp_path), "--listen", endpoint)
        with Client(SITE, connect=[endpoint]) as client:
            wait_until(lambda: connected(client), "the sound unit was not connected", 30)
            wait_until(lambda: "not RFC 2217" in unit_status(client, "u2").detail, "the trouble is not told", 30)
            with line.lock:
                unit.make_sweep(time.monotonic())
            wait_until(lambda: not unit.ring, "the sound unit is not served", 20)
        assert started.end("gateway") == 0


def test_two_gateways_on_one_unit_both_say_so_until_one_is_gone(tmp_path: Path) -> None:
    told = "another gateway serves it too (gateway): take it out of one site file"
    path = site_file(tmp_path, ("u1", 7, "socket://127.0.0.1:9", FIXED))
    (port,) = free_ports(1)
    with (
        bus.open_session(listen=[f"tcp/127.0.0.1:{port}"]) as router,
        running(path, tmp_path / "first", router) as first,
        bus.open_session(connect=[f"tcp/127.0.0.1:{port}"]) as joined,
    ):

        def details(gateway: Gateway) -> str:
            return next(status.detail for status in gateway.statuses() if isinstance(status, UnitStatus))

        with running(path, tmp_path / "second", joined) as second:
            for gateway in (first, second):
                wait_until(lambda: details(gateway).startswith(told), "no alarm", 20)  # noqa: B023
        wait_until(lambda: told not in details(first), "the alarm stays", 20)
