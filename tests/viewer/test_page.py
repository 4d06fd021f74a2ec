"""The page in a browser says when it shows the past. A small server stands where Rerun's own serves its files."""

import socketserver
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from http.server import BaseHTTPRequestHandler

import pytest
from playwright.sync_api import Page, sync_playwright
from system.processes import PATIENCE_S, free_ports, wait_until
from viewer.browser import CHROMIUM

from noctule_viewer import page


class Files(BaseHTTPRequestHandler):
    """Rerun's page without Rerun: a body, and nothing in it."""

    def do_GET(self) -> None:
        content = b"<html><head></head><body>the map</body></html>"
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture(scope="module")
def files() -> Iterator[tuple[str, int]]:
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Files) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield "127.0.0.1", server.server_address[1]
        server.shutdown()


@pytest.fixture
def shown() -> Iterator[Page]:
    with (
        sync_playwright() as playwright,
        playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox"], timeout=1e3 * PATIENCE_S
        ) as chromium,
    ):
        made = chromium.new_page()
        made.set_default_timeout(1e3 * PATIENCE_S)
        yield made


class Relay:
    silent_s = 0.0


@contextmanager
def served(port: int, files: tuple[str, int], relay: Relay) -> Iterator[None]:
    with page.serving(("127.0.0.1", port), files, "http://127.0.0.1:1", lambda: relay.silent_s):
        yield


def bar(shown: Page) -> str:
    """What the bar above the page says, empty while it is hidden."""
    found = shown.locator("#noctule-stale")
    return found.inner_text() if found.is_visible() else ""


def pass_time(shown: Page) -> bool:
    """Two seconds for the page's clock, after which it looks once."""
    shown.clock.run_for(2_000)
    return True


def test_the_page_says_when_its_relay_is_frozen_and_when_it_is_gone_and_loads_again_with_a_new_one(
    files: tuple[str, int], shown: Page
) -> None:
    (port,) = free_ports(1)
    relay = Relay()
    shown.clock.install()
    with served(port, files, relay):
        with shown.expect_response("**/noctule/alive"):
            shown.goto(f"http://127.0.0.1:{port}/?url=x")
            pass_time(shown)
        relay.silent_s = 32.0  # as long as it takes the viewer to notice, see test_pulse.py
        told = "The relay has not answered for 32 s: this page shows the past."
        wait_until(lambda: pass_time(shown) and bar(shown) == told, "a frozen relay is not told")
        relay.silent_s = 0.0
        wait_until(lambda: pass_time(shown) and not bar(shown), "a relay that answers again is not told")
    wait_until(lambda: pass_time(shown) and bar(shown), "a relay that is gone is not told")
    with ExitStack() as closing, shown.expect_event("load"):
        closing.enter_context(served(port, files, relay))
        pass_time(shown)
