"""The gateway whole, and the times that it tells: oscillators that are off, a host's clock that is set."""

import time
from pathlib import Path

import pytest
import zenoh
from gateway.model_unit import ModelUnit
from gateway.serving import FIXED, SITE, connected, running, site_file, unit_status
from gateway.tcp_unit import tcp_unit
from google.protobuf.timestamp_pb2 import Timestamp
from system.processes import wait_until

from noctule import elapsed
from noctule.client import Client
from noctule.elapsed import Instant
from noctule.kernel_clock import KernelClock
from noctule.messages_pb2 import (
    Pose,
    ServiceStatus,
    Sweep,
)


def test_an_oscillator_that_is_one_percent_fast_is_taken_out_of_a_sweeps_times(
    tmp_path: Path, router: zenoh.Session
) -> None:
    unit = ModelUnit(7, born_s=time.monotonic(), drift=0.01)
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        got: list[Sweep] = []
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            client.on_sweep(got.append)
            wait_until(lambda: connected(client), "the unit was not connected")

            def corrected() -> bool:
                with line.lock:
                    unit.make_sweep(time.monotonic())
                return any(sweep.HasField("clock_drift") for sweep in got)

            wait_until(corrected, "the drift did not become known")
    sweep = next(sweep for sweep in got if sweep.HasField("clock_drift"))
    made = unit.made[sweep.sequence - 1]
    # Three standard deviations of what the gateway asks of a drift: 200 ppm.
    assert sweep.readings[0].time_of_flight_s == pytest.approx(made.readings[0].echo / 4e6 / 1.01, rel=6e-4)


def test_a_trackers_own_time_of_a_pose_counts_and_not_when_it_came(tmp_path: Path, router: zenoh.Session) -> None:
    unit = ModelUnit(7, born_s=time.monotonic())
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, 'pose = "key"'))
        got: list[Sweep] = []
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            client.on_sweep(got.append)
            wait_until(lambda: connected(client), "the unit was not connected")
            now_s = int(time.time())
            client.publish_pose("u1", Pose(x_m=9.0, time=Timestamp(seconds=now_s + 3600)))  # of a clock that is wrong
            client.publish_pose("u1", Pose(x_m=0.0, time=Timestamp(seconds=now_s - 50)))
            client.publish_pose("u1", Pose(x_m=1e300, time=Timestamp(seconds=now_s + 10)))  # no place on Earth
            client.publish_pose("u1", Pose(x_m=200.0, time=Timestamp(seconds=now_s + 50)))

            def placed() -> bool:
                with line.lock:
                    unit.make_sweep(time.monotonic())
                return any(sweep.pose.x_m > 0 for sweep in got)

            wait_until(placed, "no sweep got a pose between the two")  # one before the second pose came lies at 0
        assert got[-1].pose.x_m == pytest.approx(100.0, abs=60.0)  # half-way, and 2 m further each second


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
                    lambda most=made: unit_status(client).log_head == most and not unit.ring, "no sweep was logged"
                )
                gateway.report()
            wait_until(lambda: services and services[-1].counters["clock_sets"] == 3, "it was not counted")
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
            wait_until(lambda: connected(client), "the unit was not connected")
            client.publish_pose("u1", Pose(x_m=3.0))

            def placed() -> bool:
                with line.lock:
                    unit.make_sweep(time.monotonic())
                return any(sweep.HasField("pose") for sweep in got)

            wait_until(placed, "no sweep got the pose")
            set_s, before = days * 86400.0, got[-1]
            with line.lock:
                unit.make_sweep(time.monotonic())
            wait_until(lambda: got[-1].clock_epoch != before.clock_epoch, "no sweep came after the set")
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
                wait_until(lambda: unit_status(client).log_head == number, "no sweep was logged")  # noqa: B023
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
