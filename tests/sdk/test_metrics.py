"""Statuses as Prometheus reads them, over a real port; names follow https://prometheus.io/docs/practices/naming/."""

import contextlib
import os
import re
import socket
import struct
import threading
import time
from collections.abc import Iterator, Sequence
from urllib.request import urlopen

import pytest
from prometheus_client import CollectorRegistry
from prometheus_client.exposition import generate_latest
from prometheus_client.parser import text_string_to_metric_families
from system.processes import PATIENCE_S, wait_until

from noctule import metrics, metrics_server
from noctule.messages_pb2 import Contour, ServiceStatus, UnitStatus
from noctule.metrics import StatusCollector
from noctule.metrics_server import MetricsError

NOW_S = 1_700_000_000.0
UNIT = {"site": "attic", "unit": "u7", "service": "gw"}
GATEWAY = {"site": "attic", "service": "gw"}

Samples = dict[tuple[str, frozenset[tuple[str, str]]], float]


def samples(*statuses: UnitStatus | ServiceStatus | Contour) -> Samples:
    registry = CollectorRegistry()
    registry.register(StatusCollector(lambda: statuses, lambda: NOW_S))
    return parsed(generate_latest(registry).decode())


def parsed(page: str) -> Samples:
    families = text_string_to_metric_families(page)
    return {(each.name, frozenset(each.labels.items())): each.value for family in families for each in family.samples}


def value(found: Samples, name: str, labels: dict[str, str]) -> float:
    return found[name, frozenset(labels.items())]


def unit_status() -> UnitStatus:
    status = UnitStatus(
        site="attic",
        unit="u7",
        gateway="gw",
        firmware="1.4.0",
        detail="much can't be read",
        state=UnitStatus.STATE_SWEEPING,
        clock_error_s=2e-5,
        clock_drift=-0.011,
        chip_temperature_c=31.5,
        log_head=120,
        log_tail=21,
        log_removed=20,
        log_damaged=3,
        counters={"frames_bad": 9, "unit_frames_bad": 4, "late_ms": 250, "log_bytes": 4096, "unit_sweeps_waiting": 2},
    )
    status.time.FromSeconds(int(NOW_S) - 3)
    return status


def service_status() -> ServiceStatus:
    status = ServiceStatus(
        site="attic",
        name="gw",
        role="gateway",
        version="0.1.0",
        counters={"units": 5, "sweeps_committed": 70},
    )
    status.time.FromSeconds(int(NOW_S) - 1)
    return status


def test_a_units_status_is_shown_with_its_units_of_measure_and_its_labels() -> None:
    found = samples(unit_status())
    expected = {
        "noctule_clock_error_seconds": 2e-5,
        "noctule_clock_drift_ratio": -0.011,
        "noctule_unit_chip_temperature_celsius": 31.5,
        "noctule_log_head": 120,
        "noctule_log_tail": 21,
        "noctule_log_removed_total": 20,
        "noctule_log_damaged_total": 3,
        "noctule_frames_bad_total": 9,
        "noctule_unit_frames_bad_total": 4,
        "noctule_late_seconds": 0.25,
        "noctule_log_bytes": 4096,
        "noctule_unit_sweeps_waiting": 2,
        "noctule_unit_status_age_seconds": 3,
        "noctule_unit_trouble": 1,
    }
    assert {name: value(found, name, UNIT) for name in expected} == pytest.approx(expected)
    assert value(found, "noctule_unit_firmware_info", UNIT | {"version": "1.4.0"}) == 1


def test_of_all_the_states_of_a_unit_the_present_one_is_1() -> None:
    found = samples(unit_status())
    states = {dict(labels)["state"]: on for (name, labels), on in found.items() if name == "noctule_unit_state"}
    assert {state for state, on in states.items() if on} == {"sweeping"}
    assert states.keys() >= {"disconnected", "fault", "loader"}


def test_a_service_shows_its_version_and_its_counters_under_its_role() -> None:
    found = samples(service_status())
    assert value(found, "noctule_build_info", GATEWAY | {"role": "gateway", "version": "0.1.0"}) == 1
    assert value(found, "noctule_gateway_units", GATEWAY) == 5
    assert value(found, "noctule_gateway_sweeps_committed_total", GATEWAY) == 70
    assert value(found, "noctule_service_status_age_seconds", GATEWAY) == 1


def test_a_contour_shows_its_age_and_what_it_holds() -> None:
    contour = Contour(site="attic", mapper="m", version=8, sweeps=44)
    contour.walls.add()
    contour.time.FromSeconds(int(NOW_S) - 12)
    found, labels = samples(contour), {"site": "attic", "service": "m"}
    assert value(found, "noctule_contour_age_seconds", labels) == 12
    assert value(found, "noctule_contour_sweeps", labels) == 44
    assert value(found, "noctule_contour_objects", labels | {"kind": "wall"}) == 1
    assert value(found, "noctule_contour_objects", labels | {"kind": "cylinder"}) == 0


def test_a_counter_of_any_name_makes_a_page_that_prometheus_reads() -> None:
    status = ServiceStatus(name="s", role="door opener/2", counters={"doors opened\n": 3, "": 1})
    found = samples(status)
    assert value(found, "noctule_door_opener_2_doors_opened__total", {"site": "", "service": "s"}) == 3
    assert all(re.fullmatch(r"[a-z][a-z0-9_]*", name) for name, _ in found)


# ---- The address that is scraped ----


class Served:
    """A service's metrics on a free port; ``asked`` counts how often its statuses were asked for."""

    def __init__(self) -> None:
        self.asked = 0

    def statuses(self) -> Sequence[ServiceStatus]:
        self.asked += 1
        return [service_status()]


@pytest.fixture
def served(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Served, int]]:
    """No connection is closed because it is quiet for long."""
    monkeypatch.setattr(metrics_server._Handler, "timeout", 10 * PATIENCE_S)
    shown = Served()
    caplog.set_level("INFO")
    with metrics_server.serving("0", metrics.registry(shown.statuses)):
        (port,) = re.findall(r"metrics at http://127\.0\.0\.1:(\d+)/metrics", caplog.text)
        yield shown, int(port)


def scrape(port: int) -> Samples:
    with urlopen(f"http://127.0.0.1:{port}/metrics", timeout=60) as reply:
        assert reply.headers["Content-Type"].startswith("text/plain; version=")
        return parsed(reply.read().decode())


def test_a_scrape_also_shows_the_memory_and_the_cpu_time_of_the_process(served: tuple[Served, int]) -> None:
    found = scrape(served[1])
    assert value(found, "process_resident_memory_bytes", {}) > 1e6
    assert value(found, "noctule_gateway_units", GATEWAY) == 5


def test_a_flood_of_scrapes_costs_the_service_one_page_a_second(served: tuple[Served, int]) -> None:
    shown, port = served
    began_s, asked = time.monotonic(), shown.asked
    for _ in range(40):
        scrape(port)
    assert shown.asked - asked <= 1 + (time.monotonic() - began_s)


def test_connections_that_ask_nothing_take_no_more_than_eight_threads(served: tuple[Served, int]) -> None:
    _, port = served
    before = threading.active_count()
    with contextlib.ExitStack() as stack:
        idle = [stack.enter_context(socket.create_connection(("127.0.0.1", port), 60)) for _ in range(9)]
        assert idle[8].recv(1) == b""  # closed at once, because eight are open
        assert threading.active_count() - before <= 8


@pytest.mark.parametrize(
    "asked", [b"", b"GET", b"GET http://[ HTTP/1.1\r\n\r\n", b"\0" * 70_000, b"GET / HTTP/9\r\n\r\n"]
)
def test_a_port_scanner_that_hangs_up_leaves_no_traceback_in_the_log(
    served: tuple[Served, int], caplog: pytest.LogCaptureFixture, asked: bytes
) -> None:
    _, port = served
    with socket.create_connection(("127.0.0.1", port), timeout=60) as scanner:
        scanner.sendall(asked)
        # On close() the far end gets a reset.
        scanner.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    scrape(port)
    wait_until(lambda: not any("process_request" in each.name for each in threading.enumerate()), "it is still served")
    assert not [record for record in caplog.records if record.exc_info]


def test_without_a_host_the_address_is_on_loopback() -> None:
    assert metrics_server.address("9464") == ("127.0.0.1", 9464)
    assert metrics_server.address(":9464") == ("127.0.0.1", 9464)
    assert metrics_server.address("0.0.0.0:9464") == ("0.0.0.0", 9464)
    assert metrics_server.address("[::1]:9464") == ("::1", 9464)


@pytest.mark.parametrize("text", ["", "host", "host:port", "host:70000", "[::1"])
def test_what_is_no_address_is_refused_with_one_that_is(text: str) -> None:
    with pytest.raises(MetricsError, match=re.escape("give HOST:PORT or PORT, as in 127.0.0.1:9464")):
        metrics_server.address(text)


def test_a_port_that_is_taken_is_named(served: tuple[Served, int]) -> None:
    where = f"127.0.0.1:{served[1]}"
    with (
        pytest.raises(MetricsError, match=rf"at {where}: port {served[1]} is in use by .+ \(process {os.getpid()}\): "),
        metrics_server.serving(where, CollectorRegistry()),
    ):
        pass
