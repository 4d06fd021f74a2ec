"""A host of a small fleet runs as rendered: its units' commands, certificates and system call filters."""

import base64
import http.client
import re
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from deploy.mapper_store import stored_sweeps
from deploy.rendered_host import RenderedHost
from mapper.rerun_relay import viewer
from system.processes import PATIENCE_S, ROOT, free_ports, listens, programs, wait_until
from typer.testing import CliRunner, Result

from noctule import rerun_paths
from noctule_deploy import cli

FLEET = """
[[router]]
name = "one"
address = "127.0.0.1"
listen = "127.0.0.1"
port = {zenoh}

[[gateway]]
name = "attic"
site = "paper-room"
units = ["u1"]
host = "box"
site_file = "paper-room.toml"
router = "one"

[[mapper]]
name = "cartographer"
sites = ["paper-room"]
host = "box"

[[viewer]]
name = "screen"
sites = ["paper-room"]
host = "box"
port = {relay}
web_port = {files}
web = {{ name = "localhost", port = {page}, users = {{ anna = "{hashed}" }} }}

[[operator]]
name = "anna"
sites = ["*"]
"""
PROGRAMS = ("router.one", "gateway.attic", "mapper.cartographer", "viewer.screen", "web.screen")
PASSWORD = "night-flight"
HASHED = "$2b$04$abcdefghijklmnopqrstuubKjiNwI71ul7nETs8D9Wbpfd3CpQAoS"  # bcrypt at its least cost
READ, WRITE = (f"/rerun.sdk_comms.v1alpha1.MessageProxyService/{name}Messages" for name in ("Read", "Write"))
# SQLite gives files of root to their folder's owner (fchown), which a service that is not root never tries. Rust's
# allocator asks for memory of this processor (mbind), and goes on without.
HARMLESS = {"fchown", "mbind"}


@pytest.fixture
def ports() -> dict[str, int]:
    """A port of its own for each of what listens."""
    names = ("unit", "zenoh", "relay", "files", "page")
    return dict(zip(names, free_ports(len(names)), strict=True))


@pytest.fixture
def host(tmp_path: Path, ports: dict[str, int]) -> RenderedHost:
    """The only host of the fleet, rendered and installed below a folder."""
    site = (ROOT / "deploy/demo/sites/paper.toml").read_text()
    (tmp_path / "paper-room.toml").write_text(site.replace("127.0.0.1:7101", f"127.0.0.1:{ports['unit']}"))
    (tmp_path / "fleet.toml").write_text(FLEET.format(hashed=HASHED, **ports))
    assert deploy(tmp_path, "render").exit_code == 0
    rendered = RenderedHost(tmp_path / "rendered/box", tmp_path / "root")
    rendered.install()
    return rendered


def deploy(folder: Path, command: str) -> Result:
    return CliRunner().invoke(cli.app, [command, str(folder / "fleet.toml"), "--out", str(folder / "rendered")])


def states(folder: Path) -> dict[str, str]:
    """The state of each program, as the status shows it; none where no router answers yet."""
    lines = deploy(folder, "status").output.splitlines()
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in lines if line.startswith("│")]
    return {row[1]: row[3] for row in rows}


@contextmanager
def asked(port: int, method: str, path: str, password: str | None = PASSWORD) -> Iterator[http.client.HTTPResponse]:
    """What the page's host answers."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE  # Caddy's own authority is of this test only
    connection = http.client.HTTPSConnection("localhost", port, context=context, timeout=PATIENCE_S)
    headers = {"Content-Type": "application/grpc-web+proto"} if method == "POST" else {}
    if password:
        headers["Authorization"] = "Basic " + base64.b64encode(f"anna:{password}".encode()).decode()
    try:
        connection.request(method, path, b"\0\0\0\0\0" if method == "POST" else None, headers)
        yield connection.getresponse()
    finally:
        connection.close()


def answer(port: int, method: str, path: str, password: str | None = PASSWORD) -> tuple[int, bytes]:
    """Status and first bytes of what the page's host answers."""
    with asked(port, method, path, password) as reply:
        return reply.status, reply.read(16)


def streams(port: int, wanted: bytes) -> bool:
    """What comes behind the page's login has ``wanted`` in it; the stream ends only with the connection."""
    with asked(port, "POST", READ) as reply:
        got = b""
        while wanted not in got:
            more = reply.read1(65536)
            assert more, "the stream has ended"
            got = got[-len(wanted) :] + more
    return True


def refused(host: RenderedHost) -> set[str]:
    """The system calls that the units' filters have refused."""
    logs = (host.calls(service).read_text() for service in host.services())
    return {call for log in logs for call in re.findall(r"^(?:\d+ +)?(\w+)\(", log, re.MULTILINE)}


def check_page(port: int) -> None:
    """Nobody gets in without a password; who does sees page and map, and may not write."""
    for path in ("/", "/?url=x", "/signed-in"):
        assert answer(port, "GET", path, password=None)[0] == 401
        assert answer(port, "GET", path, password="guessed")[0] == 401
    assert answer(port, "POST", READ, password=None)[0] == 401
    assert answer(port, "GET", "/")[0] == 302  # to the page with the relay's address
    assert answer(port, "GET", f"/?url=rerun%2Bhttps%3A%2F%2Flocalhost%3A{port}%2Fproxy") == (200, b"<!doctype html>\n")
    assert answer(port, "POST", WRITE)[0] == 403


def test_a_rendered_host_maps_its_site_and_serves_the_map_to_those_who_log_in(
    host: RenderedHost, ports: dict[str, int], tmp_path: Path
) -> None:
    data = host.root / "var/lib/noctule/mapper.cartographer"
    unit = ("--room", "paper", "--speed", "24", "--exact-clocks", "--seed", "7", "--tcp", f"127.0.0.1:{ports['unit']}")
    with programs(tmp_path) as running:
        running.start("simulator", "noctule-sim", "--firmware", "firmware/build/noctule.ihx", *unit)
        for service in host.services():
            host.start(running, service)

        def up() -> bool:
            running.check()
            store = data / "paper-room.sqlite3"
            return stored_sweeps(store) >= 10 and listens(ports["page"]) and listens(ports["files"])

        wait_until(up, "no sweeps are stored, or there is no page")
        check_page(ports["page"])
        with viewer(f"rerun+http://127.0.0.1:{ports['relay']}/proxy", tmp_path) as beside:
            beside.values(rerun_paths.WALLS, "LineStrips2D:strips")
        # Layouts name it without the slash at the front.
        assert streams(ports["page"], f"/{rerun_paths.WALLS}".encode())
        wait_until(lambda: states(tmp_path) == dict.fromkeys(PROGRAMS, "well"), "not all are well", every_s=1.0)
        running.kill("noctule-mapper-cartographer")
        left = {"mapper.cartographer": "away"}
        wait_until(lambda: states(tmp_path) == dict.fromkeys(PROGRAMS, "well") | left, "it is not missed", every_s=1.0)
        assert deploy(tmp_path, "status").exit_code == 1
        for service in set(host.services()) - {"noctule-mapper-cartographer"}:
            assert running.end(service) == 0
    assert refused(host) <= HARMLESS
    assert not any(listens(port) for port in ports.values())
