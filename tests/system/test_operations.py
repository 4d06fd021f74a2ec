"""Each service as it is run in production: scraped, its log collected, notified to systemd, and surely ended."""

import json
import re
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from urllib.request import urlopen

import psutil
import pytest
from prometheus_client.parser import text_string_to_metric_families
from system.processes import AS_PROMISED, Programs, free_ports, programs, wait_until
from system.test_one_owner import gateway, mapper

ENDED_WITHIN_S = 15.0  # by the clock of a busy machine: what hangs hangs for ever, and sdk/test_ending.py holds the 5 s
SERVICES = ["gateway", "mapper", "viewer"]


@contextmanager
def systemd(folder: Path) -> Iterator[tuple[socket.socket, dict[str, str]]]:
    """Systemd's end of the socket, and the environment that it gives a service."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(str(folder / "notify"))
        receiver.settimeout(90)
        yield receiver, AS_PROMISED | {"NOTIFY_SOCKET": str(folder / "notify")}


def wait_for_line(receiver: socket.socket, line: str) -> None:
    """Read what systemd gets until ``line`` is among it."""
    wait_until(lambda: line in receiver.recv(4096).decode().splitlines(), f"systemd is not told {line}", every_s=0.0)


def read_all(receiver: socket.socket) -> None:
    """Make room for what comes: where nobody reads, the kernel keeps a few messages and drops the others."""
    patience_s = receiver.gettimeout()
    receiver.setblocking(False)
    with suppress(BlockingIOError):
        while receiver.recv(4096):
            pass
    receiver.settimeout(patience_s)


def viewer() -> tuple[str, ...]:
    port, web_port = free_ports(2)
    return "noctule-viewer", "run", "--port", str(port), "--web-port", str(web_port)


def command(role: str, folder: Path, running: Programs) -> tuple[str, ...]:
    """A service whose log is JSON and whose metrics are on a free port; a mapper gets a gateway as its router."""
    more = ("--metrics", "127.0.0.1:0", "--log-format", "json")
    match role:
        case "viewer":
            return *viewer(), *more
        case "gateway":
            return *gateway(folder, folder / "gateway"), *more
        case _:
            router = gateway(folder, folder / "router")
            running.start("router", *router)
            return *mapper(folder / "mapper")[:-3], router[-1], "--rerun", "none", *more


def log_lines(running: Programs, name: str) -> list[dict[str, str]]:
    """The lines of the log, each of which must be JSON."""
    *lines, _ = running.log(name).split("\n")  # the last one may not be whole yet
    return [json.loads(line) for line in lines]


def metrics_address(running: Programs, name: str) -> str:
    def said() -> str | None:
        running.check()
        messages = " ".join(line["message"] for line in log_lines(running, name))
        found = re.search(r"metrics at (http://\S+)", messages)
        return found and found[1]

    return wait_until(said, f"{name} has no metrics")


def scrape(address: str) -> dict[str, list[tuple[dict[str, str], float]]]:
    """Labels and value of each sample, by name."""
    with urlopen(address, timeout=60) as reply:
        families = text_string_to_metric_families(reply.read().decode())
    found: dict[str, list[tuple[dict[str, str], float]]] = {}
    for family in families:
        for sample in family.samples:
            found.setdefault(sample.name, []).append((sample.labels, sample.value))
    return found


def end_in_time(running: Programs, name: str) -> int:
    began_s = time.monotonic()
    status = running.end(name)
    assert time.monotonic() - began_s < ENDED_WITHIN_S, running.log(name)
    return status


@pytest.mark.parametrize("role", SERVICES)
def test_a_service_is_scraped_logs_json_notifies_systemd_and_ends_on_sigterm(tmp_path: Path, role: str) -> None:
    with programs(tmp_path) as running, systemd(tmp_path) as (receiver, env):
        running.start("service", *command(role, tmp_path, running), env=env)
        wait_for_line(receiver, "READY=1")
        wait_for_line(receiver, "WATCHDOG=1")
        found = scrape(metrics_address(running, "service"))
        ((labels, _),) = found["noctule_build_info"]
        assert (labels["role"], labels["version"]) == (role, version(f"noctule-{role}"))
        assert found["process_resident_memory_bytes"][0][1] > 1e6
        assert found["noctule_service_status_age_seconds"][0][1] < 10
        if role == "gateway":
            unit = {"site": "attic", "unit": "u1", "service": "gateway"}
            assert (unit, 0.0) in found["noctule_log_head"]
            assert (unit | {"state": "disconnected"}, 1.0) in found["noctule_unit_state"]
        if role == "viewer":
            assert found["noctule_child_process_resident_memory_bytes"][0][1] > 1e6
        read_all(receiver)
        assert end_in_time(running, "service") == 0
        wait_for_line(receiver, "STOPPING=1")
        for line in log_lines(running, "service"):
            assert line.keys() == {"time", "level", "logger", "message"}


@pytest.mark.parametrize("role", ["gateway", "mapper"])
def test_without_a_router_a_service_is_scraped_too_and_a_gateway_is_ready(tmp_path: Path, role: str) -> None:
    where = ("--connect", "tcp/127.0.0.1:9")  # the discard port, where nothing listens
    more = (*where, "--metrics", "127.0.0.1:0", "--log-format", "json")
    whole = gateway(tmp_path, tmp_path / "data")[:-2] if role == "gateway" else mapper(tmp_path / "data")
    with programs(tmp_path) as running, systemd(tmp_path) as (receiver, env):
        running.start("service", *whole, *more, env=env)
        wait_for_line(receiver, "READY=1" if role == "gateway" else "EXTEND_TIMEOUT_USEC=30000000")
        assert scrape(metrics_address(running, "service"))["noctule_build_info"][0][0]["role"] == role
        assert end_in_time(running, "service") == 0


@pytest.mark.parametrize("role", ["gateway", "mapper"])
def test_a_service_whose_router_hangs_ends_in_time(tmp_path: Path, role: str) -> None:
    router = gateway(tmp_path, tmp_path / "router", "cellar")
    with programs(tmp_path) as running, systemd(tmp_path) as (receiver, env):
        running.start("router", *router)
        if role == "gateway":
            whole = *gateway(tmp_path, tmp_path / "data")[:-2], "--connect", router[-1]
        else:
            whole = *mapper(tmp_path / "data")[:-3], router[-1], "--rerun", "none"
        running.start("service", *whole, env=env)
        wait_for_line(receiver, "READY=1")
        psutil.Process(running.pid("router")).send_signal(signal.SIGSTOP)
        assert end_in_time(running, "service") in (0, 1)
        assert "Traceback" not in running.log("service")


def test_a_gateway_ends_in_time_though_a_line_hangs_and_says_which(tmp_path: Path) -> None:
    with programs(tmp_path) as running, systemd(tmp_path) as (receiver, env), ExitStack() as stack:
        # A listener whose queue is full answers no SYN, so that opening the line takes its time-out of 5 s.
        busy = stack.enter_context(socket.create_server(("127.0.0.1", 0), backlog=0))
        port = busy.getsockname()[1]
        stack.enter_context(socket.create_connection(("127.0.0.1", port)))
        whole = gateway(tmp_path, tmp_path / "data")
        site = tmp_path / "attic.toml"
        site.write_text(site.read_text().replace("127.0.0.1:9", f"127.0.0.1:{port}"))
        running.start("service", *whole, env=env)
        wait_for_line(receiver, "READY=1")
        assert end_in_time(running, "service") in (0, 1)
        assert f"u1: the line hangs and was left as it is: socket://127.0.0.1:{port}" in running.log("service")


def test_a_frozen_relay_gets_no_more_pings_and_ends_in_time(tmp_path: Path) -> None:
    with programs(tmp_path) as running, systemd(tmp_path) as (receiver, env):
        running.start("viewer", *command("viewer", tmp_path, running), env=env)
        wait_for_line(receiver, "READY=1")
        (relay,) = [each for each in psutil.Process(running.pid("viewer")).children() if each.name() == "rerun"]
        relay.suspend()
        # Three looks, ten seconds apart, get no answer; the loop goes on and tells its status.
        wait_until(lambda: "WATCHDOG=1" not in receiver.recv(4096).decode(), "it pings on", every_s=0)
        failed = scrape(metrics_address(running, "viewer"))["noctule_viewer_relay_looks_failed_total"]
        assert failed[0][1] >= 3
        assert end_in_time(running, "viewer") == 0
