"""Watching from elsewhere as the README says: ssh carries page and drawings; a viewer of another version is told."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from urllib.request import urlopen

import asyncssh
import pytest
from mapper.rerun_relay import viewer
from system.processes import Programs, free_ports, listens, programs, wait_until
from viewer.relay_rig import log_room, run_viewer, start_relay

from noctule import rerun_paths
from noctule_viewer import rerun_versions


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Programs]:
    with programs(tmp_path) as made:
        yield made


class Forwarding(asyncssh.SSHServer):
    """Lets who has the key reach any port of loopback."""

    def connection_requested(self, dest_host: str, dest_port: int, orig_host: str, orig_port: int) -> bool:  # noqa: ARG002
        return dest_host == "127.0.0.1"


@contextmanager
def ssh_server(folder: Path) -> Iterator[list[str]]:
    """An ssh server on loopback; the words of an ssh command that reaches it."""
    for name in ("host", "user"):
        asyncssh.generate_private_key("ssh-ed25519").write_private_key(str(folder / name))
        asyncssh.read_private_key(str(folder / name)).write_public_key(str(folder / f"{name}.pub"))
        (folder / name).chmod(0o600)
    loop = asyncio.new_event_loop()
    thread = Thread(target=loop.run_forever)
    thread.start()

    async def served() -> asyncssh.SSHAcceptor:
        keys = {"server_host_keys": [str(folder / "host")], "authorized_client_keys": str(folder / "user.pub")}
        return await asyncssh.listen("127.0.0.1", 0, server_factory=Forwarding, **keys)

    async def closed(server: asyncssh.SSHAcceptor) -> None:
        server.close()
        await server.wait_closed()

    server = asyncio.run_coroutine_threadsafe(served(), loop).result()
    try:
        port = server.get_port()
        (folder / "known").write_text(f"[127.0.0.1]:{port} {(folder / 'host.pub').read_text()}")
        known = f"-oUserKnownHostsFile={folder}/known"
        yield ["ssh", "-F", "none", "-i", str(folder / "user"), known, "-p", str(port), "operator@127.0.0.1"]
    finally:
        asyncio.run_coroutine_threadsafe(closed(server), loop).result()
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


def test_through_ssh_the_page_opens_and_a_native_viewer_sees_what_is_drawn(running: Programs, tmp_path: Path) -> None:
    relay = start_relay(running)
    with ssh_server(tmp_path) as (*ssh, host):
        page, data = free_ports(2)
        forwarded = [f"-L{page}:127.0.0.1:{relay.web_port}", f"-L{data}:127.0.0.1:{relay.port}"]
        running.start("ssh", *ssh, "-N", "-o", "ExitOnForwardFailure=yes", *forwarded, host)
        wait_until(lambda: listens(page) and listens(data), f"ssh does not forward: {running.log('ssh')}")

        log_room(relay)
        with urlopen(f"http://127.0.0.1:{page}") as opened:
            assert b"<title>Rerun Viewer</title>" in opened.read()
        url = f"rerun+http://127.0.0.1:{data}/proxy"
        (tmp_path / "far").mkdir()
        with viewer(url, tmp_path / "far") as far:
            far.wait_for(rerun_paths.WALLS)
        assert run_viewer("open", "--url", url, "--web-port", str(page)).stderr == ""
        running.end("ssh")
        running.end("viewer")


class OtherVersion(BaseHTTPRequestHandler):
    """The page of a relay with another Rerun."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b'{"rerun": "0.1.7"}')

    def log_message(self, format: str, *args: object) -> None: ...


def test_a_native_viewer_whose_rerun_is_not_the_relays_says_so() -> None:
    with ThreadingHTTPServer(("127.0.0.1", 0), OtherVersion) as page:
        thread = Thread(target=page.serve_forever)
        thread.start()
        try:
            told = run_viewer("open", "--web-port", str(page.server_port))
        finally:
            page.shutdown()
            thread.join()
    assert "and the relay is 0.1.7: install the relay's release of Noctule here" in told.stderr
    (nobody,) = free_ports(1)
    assert "the relay's version of Rerun could not be asked for" in run_viewer("open", "--web-port", str(nobody)).stderr


@pytest.mark.parametrize(("own", "relay", "differs"), [("0.41.0", "0.41.3", False), ("0.41.0", "0.40.0", True)])
def test_versions_differ_by_their_second_number(own: str, relay: str, differs: bool) -> None:
    assert bool(rerun_versions.of_native_viewer(own, relay)) is differs
