"""Watching from elsewhere: page and data under one name behind a real Caddy, as noctule-deploy renders it."""

import base64
import http.client
import ssl
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from system.processes import PATIENCE_S, Programs, free_ports, listens, programs, wait_until
from viewer.browser import chromium, screen
from viewer.relay_rig import CYLINDER, log_room, middle_row, start_relay

from noctule_deploy.caddy import caddyfile
from noctule_deploy.fleet import Viewer, Web
from noctule_viewer.relay import Relay

USER, PASSWORD = "anna", "night-flight"
HASHED = "$2b$04$abcdefghijklmnopqrstuubKjiNwI71ul7nETs8D9Wbpfd3CpQAoS"  # bcrypt at its least cost
SERVICE = "/rerun.sdk_comms.v1alpha1.MessageProxyService"
CONTROL = "/rerun.viewer_control.v1alpha1.ViewerControlService"


@dataclass(frozen=True)
class Site:
    """A relay with the page in front of it."""

    relay: Relay
    port: int

    def status(self, method: str, path: str, password: str | None = PASSWORD) -> int:
        """What a request is answered with."""
        context = ssl.create_default_context()
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE  # its authority is of this test only
        connection = http.client.HTTPSConnection("localhost", self.port, context=context, timeout=PATIENCE_S)
        login = base64.b64encode(f"{USER}:{password}".encode()).decode()
        headers = {"Content-Type": "application/grpc-web+proto"}
        if password is not None:
            headers["Authorization"] = f"Basic {login}"
        try:
            connection.request(method, path, b"\0\0\0\0\0" if method == "POST" else None, headers)
            return connection.getresponse().status
        finally:
            connection.close()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("caddy")
    with programs(folder) as running:
        relay = start_relay(running)
        log_room(relay)
        yield Site(relay, start_caddy(running, folder, relay))


def start_caddy(running: Programs, folder: Path, relay: Relay) -> int:
    """Caddy in front of the relay; its port."""
    (port,) = free_ports(1)
    web = Web.model_validate({"name": "localhost", "port": port, "users": {USER: HASHED}})
    viewer = Viewer.model_validate(
        {"name": "screen", "sites": ["house"], "port": relay.port, "web_port": relay.web_port, "web": web}
    )
    file = folder / "Caddyfile"
    file.write_text(caddyfile(viewer, web))
    command = ("caddy", "run", "--adapter", "caddyfile", "--config", str(file))
    running.start("caddy", *command, env={"XDG_DATA_HOME": str(folder), "HOME": str(folder)})
    wait_until(lambda: listens(port), "Caddy does not listen")
    return port


def test_who_logs_in_sees_the_map_in_a_browser_under_one_name(site: Site) -> None:
    with chromium() as browser, screen(browser, login=(USER, PASSWORD)) as shown:
        asked: set[str] = set()
        shown.page.on("request", lambda request: asked.add(request.url))
        shown.page.goto(f"https://localhost:{site.port}/?renderer=webgl", wait_until="commit")
        assert "url=" in shown.page.url, "the bare address does not lead to the relay's page"
        shown.open(shown.page.url)
        shown.wait_for(lambda: middle_row(shown.picture(), CYLINDER) is not None, "the map is not shown")
        assert shown.complaints() == []
    here = f"https://localhost:{site.port}/"
    assert f"{here}{SERVICE[1:]}/ReadMessages" in asked
    assert {url for url in asked if url.startswith("http://127.0.0.1")} == set(), "data came past the login"


@pytest.mark.parametrize("password", [None, "guessed"])
@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/"),
        ("GET", "/?url=x"),
        ("GET", "/re_viewer.js"),
        ("GET", "/noctule/alive"),
        ("POST", f"{SERVICE}/ReadMessages"),
        ("POST", f"{SERVICE}/WriteMessages"),
    ],
)
def test_nobody_gets_anything_without_the_password(site: Site, method: str, path: str, password: str | None) -> None:
    assert site.status(method, path, password) == 401


@pytest.mark.parametrize(
    "path",
    [
        f"{SERVICE}/WriteMessages",
        f"{SERVICE}/WriteTable",
        f"{SERVICE}/writemessages",
        f"/{SERVICE}/WriteMessages",
        f"{SERVICE}/../MessageProxyService/WriteMessages",
        f"{SERVICE}/%57riteMessages",
        f"{SERVICE}/ReadMessages/../WriteMessages",
        f"{CONTROL}/ViewerControl",
    ],
)
def test_who_only_watches_can_not_write(site: Site, path: str) -> None:
    assert site.status("POST", path) in (403, 501)  # refused by Caddy, or by the page's server, which takes no POST
