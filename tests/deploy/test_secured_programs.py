"""The programs on a secured bus: a real gateway with a unit, and those who read and command it."""

import json
import logging
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
import zenoh
from deploy.secured_fleet import SecuredFleet, rendered
from gateway.model_unit import ModelUnit
from gateway.tcp_unit import TcpUnit, tcp_unit
from system.processes import Programs, programs, wait_until, within_pauses
from typer.testing import CliRunner

from noctule import bus, keys, tls
from noctule.bus_watch import BusWatch
from noctule.cli import commands
from noctule.client import Client
from noctule.log_follower import LogFollower
from noctule.messages_pb2 import Caller, CommandRequest, ServiceStatus, Sweep
from noctule.site import load
from noctule_gateway.service import Gateway

SITE = """
site = "house"
air_temperature_c = 20.0
"""
UNIT = """
[[unit]]
name = "{name}"
serial = {serial}
address = "{address}"
pose = {{ x_m = 0.0, y_m = 0.0, heading_deg = 0.0 }}
"""
NOBODY, NOBODY_EITHER = "socket://127.0.0.1:1", "socket://127.0.0.1:2"


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Programs]:
    """Processes of a test."""
    with programs(tmp_path) as started:
        yield started


@pytest.fixture
def line() -> Iterator[TcpUnit]:
    """A unit that sweeps when it is told to."""
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as served:
        yield served


def site_file(folder: Path, **units: str) -> Path:
    """The site "house" with units at these addresses; the first one has serial number 7."""
    site = folder / "site.toml"
    tables = (
        UNIT.format(name=name, serial=serial, address=address)
        for serial, (name, address) in enumerate(units.items(), start=7)
    )
    site.write_text(SITE + "".join(tables))
    return site


def start_gateway(running: Programs, folder: Path, tls_folder: Path, **units: str) -> None:
    """A gateway as a process."""
    where = ("--data", str(folder / "data"), "--tls", str(tls_folder))
    running.start("gateway", "noctule-gateway", "run", str(site_file(folder, **units)), *where)


@contextmanager
def gateway(folder: Path, tls_folder: Path, **units: str) -> Iterator[None]:
    """A gateway in this process, which is quicker to start."""
    served = Gateway(load(site_file(folder, **units)), folder / "data", tls.service_name(tls_folder, "gateway"))
    ended = threading.Event()

    def report() -> None:
        while not ended.wait(0.5):
            served.report()

    reporting = threading.Thread(target=report)
    served.start()
    with bus.open_session(tls_folder=tls_folder) as session:
        served.join(session, BusWatch(session, tls_folder=tls_folder), tls_folder)
        reporting.start()
        try:
            yield
        finally:
            ended.set()
            reporting.join()
            served.close()


def details(client: Client) -> dict[str, str]:
    """What each service of the site says of itself."""
    replies = client.session.get(keys.service_status("house", keys.ANY), consolidation=zenoh.ConsolidationMode.NONE)
    statuses = [ServiceStatus.FromString(reply.ok.payload.to_bytes()) for reply in replies if reply.ok is not None]
    return {status.name: status.detail for status in statuses}


def unsigned(operator: zenoh.Session) -> str:
    """Why a command is refused that only says that it is anna's."""
    said = Caller(session="operator.anna.g1").SerializeToString()
    request = CommandRequest(request_id="operator.anna.g1").SerializeToString()
    (reply,) = operator.get(keys.rpc("house", "u1", "home"), payload=request, attachment=said)
    assert reply.err is not None
    return reply.err.payload.to_string()


def records(log: Path, count: int) -> list[dict]:
    """What a log of commands holds, once it has so many lines: an outcome is written after its reply is sent."""
    wait_until(lambda: log.exists() and log.read_text().count("\n") >= count, f"{log.name} has not {count} lines")
    return [json.loads(each) for each in log.read_text().splitlines()]


def noctule(folder: Path, *arguments: str) -> str:
    """What the command says with that certificate, on a good end or a bad one."""
    result = CliRunner().invoke(commands, [*arguments, "--tls", str(folder)])
    return " ".join(f"{result.output} {result.exception or ''}".split())


def test_a_gateway_serves_its_operator_its_mapper_and_its_viewers(
    secured: SecuredFleet, running: Programs, line: TcpUnit, tmp_path: Path
) -> None:
    got: list[Sweep] = []
    with ExitStack() as closing:
        start_gateway(running, tmp_path, secured.folder("gateway.attic.g2"), u1=line.address, u2=NOBODY)
        session = closing.enter_context(secured.join("mapper.cartographer.g1", secured.endpoint(1)))
        client = closing.enter_context(Client("house", session=session))
        follower = LogFollower(client, got.extend, {})
        closing.callback(follower.close)
        follower.start()
        wait_until(lambda: client.units() == {"u1", "u2"}, "the mapper sees no units")
        wait_until(lambda: line.unit.carried_out, "the unit was not connected")

        assert "firmware: no image is taken: there are no firmware keys. Add them to" in running.log("gateway")

        rpc = ("rpc", "house", "u1", "single")
        assert "the routers let only operators command units" in noctule(secured.folder("viewer.screen.g1"), *rpc)
        hidden = noctule(secured.folder("gateway.barn.g1"), *rpc)
        assert "no gateway serves unit 'u1'" in hidden
        assert "ask whether the routers let gateway.barn.g1 see it" in hidden
        with line.lock:
            assert len(line.unit.carried_out) == 1  # the plan that every fixed unit gets
        assert "makes one sweep" in noctule(secured.folder("operator.anna.g1"), *rpc)
        recorded = records(tmp_path / "data" / "audit-1.jsonl", 3)
        assert [each.get("who") for each in recorded] == [None, "operator.anna.g1", None]  # file begun, given, done
        assert recorded[1]["signed"] and recorded[2]["event"] == "done"
        assert "the command is not signed" in unsigned(closing.enter_context(secured.join("operator.anna.g1")))
        claim = records(tmp_path / "data" / "refused-1.jsonl", 2)[1]
        assert (claim["who"], claim["signed"]) == ("session operator.anna.g1", False)
        assert "the command is not signed" in claim["error"]
        with line.lock:
            assert len(line.unit.carried_out) == 2
            line.unit.make_sweep(time.monotonic())
        wait_until(lambda: got, "the sweep did not come to the mapper")
        assert '"log_sequence": "1"' in noctule(secured.folder("viewer.screen.g1"), "log", "house", "u1")
        assert "nobody reads" not in details(client)["attic"]  # the name is the certificate's
    assert running.end("gateway") == 0


def test_a_gateway_of_another_site_says_within_ten_seconds_that_nobody_reads_it(
    secured: SecuredFleet, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with gateway(tmp_path, secured.folder("gateway.barn.g1"), u1=NOBODY):
        within_pauses(lambda: "nobody reads" in caplog.text, "the gateway did not see it", 10.0)
        keys_told = "noctule/@v1/house/service/barn/status, noctule/@v1/house/unit/u1/status: the rules of the router"
        assert keys_told in caplog.text and "don't allow it to gateway.barn.g1" in caplog.text
        with secured.join("operator.anna.g1") as session, Client("house", session=session) as client:
            assert (client.units(), client.unit_statuses()) == (set(), [])
        told = noctule(secured.folder("operator.anna.g1"), "units", "house")
        assert "May operator.anna.g1 read this site?" in told


def test_a_unit_that_the_fleet_file_does_not_give_the_gateway_stands_in_its_status(
    secured: SecuredFleet, tmp_path: Path
) -> None:
    with (
        gateway(tmp_path, secured.folder("gateway.attic.g2"), u1=NOBODY, u3=NOBODY_EITHER),
        secured.join("operator.anna.g1") as session,
        Client("house", session=session) as client,
    ):
        told = "nobody reads what is published on noctule/@v1/house/unit/u3/status: the rules of"
        wait_until(lambda: told in details(client).get("attic", ""), "the status does not say it")


def test_a_gateway_with_a_routers_certificate_is_the_router(tmp_path: Path) -> None:
    small = rendered(tmp_path)
    with (
        gateway(tmp_path, small.folder("router.one.g1"), u1=NOBODY),
        small.join("operator.anna.g1", small.endpoint(0)) as session,
        Client("house", session=session) as client,
    ):
        wait_until(lambda: client.units() == {"u1"}, "the units are not seen")
        wait_until(lambda: list(details(client)) == ["one"], "the gateway does not show itself")


def test_a_program_whose_key_others_may_read_says_what_to_do(tmp_path: Path) -> None:
    folder = rendered(tmp_path).folder("operator.anna.g1")
    (folder / tls.PRIVATE_KEY).chmod(0o644)
    assert "(mode 0644): chmod 600" in noctule(folder, "units", "house")


@pytest.mark.parametrize(("endpoint", "warned"), [("tcp/127.0.0.1:0", False), ("tcp/0.0.0.0:0", True)])
def test_a_router_that_anybody_may_reach_is_warned_of(
    endpoint: str, warned: bool, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING), bus.open_session(listen=[endpoint]) as session:
        assert any("can command the units" in record.getMessage() for record in caplog.records) == warned
        watch = BusWatch(session, listen=[endpoint])
        assert ("can command the units" in watch.detail()) == warned  # as long as it is so
