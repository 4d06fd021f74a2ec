"""Watching from elsewhere as the README says: ssh carries page and drawings; a viewer of another version is told."""

import getpass
import os
import shutil
import subprocess
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from urllib.request import urlopen

import pytest
from mapper.rerun_relay import viewer
from system.processes import Programs, free_ports, listens, programs, wait_until
from viewer.test_viewer import log_room, run_viewer, start_relay

from noctule import rerun_paths
from noctule_viewer import rerun_versions

SSHD = shutil.which("sshd", path="/usr/sbin:/usr/local/sbin")


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Programs]:
    with programs(tmp_path) as made:
        yield made


def start_sshd(running: Programs, folder: Path) -> list[str]:
    """An ssh server of this user's on loopback; the words of an ssh command that reaches it."""
    (port,) = free_ports(1)
    for name in ("host", "user"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", folder / name], check=True)
    Path("/run/sshd").mkdir(exist_ok=True)  # sshd of root wants it, and it is made at boot otherwise
    settings = {
        "HostKey": folder / "host",
        "AuthorizedKeysFile": folder / "user.pub",
        "PidFile": "none",
        "StrictModes": "no",
        "UsePAM": "yes",  # without it a root whose password is locked is refused, whatever its key
    }
    options = [f"-o{name}={value}" for name, value in settings.items()]
    assert SSHD is not None, "sshd is missing: apt-get install openssh-server"
    running.start("sshd", SSHD, "-D", "-e", "-f", "/dev/null", f"-oListenAddress=127.0.0.1:{port}", *options)
    wait_until(lambda: listens(port), f"sshd does not listen: {running.log('sshd')}")
    (folder / "known").write_text(f"[127.0.0.1]:{port} {(folder / 'host.pub').read_text()}")
    known = f"-oUserKnownHostsFile={folder}/known"
    return ["ssh", "-F", "none", "-i", str(folder / "user"), known, "-p", str(port), f"{getpass.getuser()}@127.0.0.1"]


@pytest.mark.skipif(os.getuid() != 0, reason="needs root for sshd's folder")
def test_through_ssh_the_page_opens_and_a_native_viewer_sees_what_is_drawn(running: Programs, tmp_path: Path) -> None:
    relay = start_relay(running)
    *ssh, host = start_sshd(running, tmp_path)
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
    for name in ("ssh", "sshd", "viewer"):
        running.end(name)


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
