"""A router that breaks, within a gateway or as a process of its own: units are served, and nothing measured is lost."""

import sys
import time
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from deploy.secured_fleet import rendered
from gateway.model_unit import ModelUnit
from gateway.serving import FIXED, SITE, running, site_file
from gateway.tcp_unit import TcpUnit, tcp_unit
from system.processes import Programs, free_ports, programs, wait_until
from system.test_operations import metrics_address, scrape

from noctule import bus, bus_config, tls
from noctule.client import Client
from noctule.errors import BusConfigError

SCRAPED = ("--metrics", "127.0.0.1:0", "--log-format", "json")
# A name of 65,536 characters and more makes Zenoh panic, in whichever session is asked for it.
PANICKING = """
import sys, threading, time
from pathlib import Path
from noctule import bus
from noctule_gateway.cli import app

def panic(when, endpoint):
    session = bus.open_session([endpoint])
    while not when.exists():
        time.sleep(0.02)
    session.get("x" * 70_000)

threading.Thread(target=panic, args=(Path(sys.argv[1]), sys.argv[2]), daemon=True).start()
app(sys.argv[3:])
"""


def make_sweep_and_wait_until_it_is_acknowledged(line: TcpUnit) -> None:
    with line.lock:
        line.unit.make_sweep(time.monotonic())

    def is_acknowledged() -> bool:
        with line.lock:
            return not line.unit.ring

    wait_until(is_acknowledged, "the sweep was not acknowledged")


def logged(client: Client) -> list[int]:
    """The sequences in the log, as it is served on the bus; empty while nobody serves it."""
    records = client.log("u1", 1)
    return [sweep.sequence for sweep in records.sweeps] if records is not None else []


def start_router(started: Programs, endpoint: str) -> None:
    started.start("router", "noctule-gateway", "router", "--listen", endpoint)


def test_units_are_served_while_a_router_of_its_own_process_is_dead_and_all_is_read_when_it_is_back(
    tmp_path: Path,
) -> None:
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    with ExitStack() as closing:
        started = closing.enter_context(programs(tmp_path))
        line = closing.enter_context(tcp_unit(ModelUnit(7, born_s=time.monotonic())))
        start_router(started, endpoint)
        session = closing.enter_context(bus.open_session([endpoint]))
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        closing.enter_context(running(path, tmp_path / "data", session))
        reader = closing.enter_context(Client(SITE, connect=[endpoint]))
        make_sweep_and_wait_until_it_is_acknowledged(line)
        wait_until(lambda: logged(reader) == [1], "the log is not served")
        started.kill("router")
        make_sweep_and_wait_until_it_is_acknowledged(line)
        start_router(started, endpoint)
        wait_until(lambda: logged(reader) == [1, 2], "the log is not served again")
        assert started.end("router") == 0


def test_a_gateway_that_a_panic_of_its_router_has_ended_comes_back_with_nothing_lost(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    with programs(tmp_path) as started, tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        run = ("run", str(path), "--data", str(tmp_path / "data"), "--listen", endpoint)
        when = tmp_path / "panic now"
        started.start("gateway", sys.executable, "-c", PANICKING, str(when), endpoint, *run)
        make_sweep_and_wait_until_it_is_acknowledged(line)
        with line.lock:
            line.unit.make_sweep(time.monotonic())  # on its way when the process ends
        when.touch()
        wait_until(lambda: started.ended() == {"gateway": 70}, "the panic did not end the gateway")
        assert "PanicException" in started.log("gateway")
        with line.lock:
            line.unit.make_sweep(time.monotonic())
        started.start("gateway", "noctule-gateway", *run)  # as systemd does
        with Client(SITE, connect=[endpoint]) as reader:
            wait_until(lambda: logged(reader) == [1, 2, 3], "a sweep was lost or doubled")
        assert started.end("gateway") == 0


def test_the_folder_of_a_client_makes_no_router(tmp_path: Path) -> None:
    folder = rendered(tmp_path).folder("viewer.screen.g1")
    with programs(tmp_path) as started:
        started.start("router", "noctule-gateway", "router", "--tls", str(folder))
        assert started.wait("router") == 1
        assert "viewer.screen.g1 is a client's and not a router's: give the folder of a router" in started.log("router")
    with pytest.raises(BusConfigError, match=r"viewer.screen.g1 is a client's .* leave --listen out"):
        bus_config.config([], ["tls/127.0.0.1:7447"], tls.load(folder, datetime.now(UTC)))


def test_a_router_and_a_recording_say_that_their_certificates_expire_soon_and_the_router_is_scraped(
    tmp_path: Path,
) -> None:
    begun = datetime.now(UTC) - timedelta(days=85)
    made = rendered(tmp_path, "valid_days = 100", begun)
    router, reader = (str(made.folder(name)) for name in ("router.one.g1", "service.alarm.g1"))
    with programs(tmp_path) as started:
        started.start("router", "noctule-gateway", "router", "--tls", router, *SCRAPED)
        record = ("noctule", "record", "house", str(tmp_path / "sweeps.jsonl"))
        started.start("record", *record, "--tls", reader)
        for name, whose in (("router", "router.one.g1"), ("record", "service.alarm.g1")):
            told = f"the certificate of {whose} expires on {begun + timedelta(days=100):%Y-%m-%d}"
            wait_until(lambda name=name, told=told: told in started.log(name), f"{name} does not say it")
        address = metrics_address(started, "router")
        one_member = ({"site": "", "service": "one"}, 1.0)  # the recording
        wait_until(lambda: scrape(address)["noctule_router_members"] == [one_member], "the members are not counted")
        assert started.end("router") == 0
