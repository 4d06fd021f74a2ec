"""The page in a browser says when it shows the past. A small server stands where Rerun's own serves its files."""

import json
import re
import socketserver
import threading
import time
from collections.abc import Iterator, Sequence
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
    troubles: Sequence[str] = ()
    drawn_s: float | None = None


def drawn(shown: Page, ago_s: float) -> None:
    """Rerun's viewer comes to what was drawn so long ago."""
    event = json.dumps({"type": "time_update", "time": (time.time() - ago_s) * 1e9})
    shown.evaluate("event => window.noctuleEvent(event)", event)


@contextmanager
def served(port: int, files: tuple[str, int], relay: Relay) -> Iterator[None]:
    state = page.State(lambda: relay.silent_s, lambda: relay.troubles, lambda: relay.drawn_s)
    with page.serving(("127.0.0.1", port), files, "http://127.0.0.1:1", state):
        yield


def bar(shown: Page) -> str:
    """What the bar above the page says, empty while it is hidden."""
    found = shown.locator("#noctule-stale")
    return found.inner_text() if found.is_visible() else ""


def told_of(shown: Page, ago_s: float) -> str:
    """What it says while Rerun's viewer keeps to what was drawn so long ago, however long the page takes to look."""
    drawn(shown, ago_s)
    return bar(shown)


RED, BLUE = "rgb(179, 38, 30)", "rgb(47, 93, 138)"


def colour(shown: Page) -> str:
    return shown.locator("#noctule-stale").evaluate("bar => getComputedStyle(bar).backgroundColor")


def pass_time(shown: Page) -> bool:
    """Two seconds for the page's clock, after which it looks once."""
    shown.clock.run_for(2_000)
    return True


def open_and_look(shown: Page, port: int) -> None:
    """Until the page has asked its server once."""
    with shown.expect_response("**/noctule/alive"):
        shown.goto(f"http://127.0.0.1:{port}/?url=x")
        pass_time(shown)


def test_the_page_says_when_its_relay_is_frozen_and_when_it_is_gone_and_loads_again_with_a_new_one(
    files: tuple[str, int], shown: Page
) -> None:
    (port,) = free_ports(1)
    relay = Relay()
    shown.clock.install()
    with served(port, files, relay):
        open_and_look(shown, port)
        relay.silent_s = 32.0  # as long as it takes the viewer to notice, see test_pulse.py
        told = "The relay has not answered for 32 s: this page shows the past."
        wait_until(lambda: pass_time(shown) and bar(shown) == told, "a frozen relay is not told")
        shown.keyboard.press(" ")  # who touches the page looks back no more than before
        seen = wait_until(lambda: pass_time(shown) and bar(shown) == told and colour(shown), "it is not told any more")
        assert seen == RED
        relay.silent_s = 0.0
        wait_until(lambda: pass_time(shown) and not bar(shown), "a relay that answers again is not told")
    wait_until(lambda: pass_time(shown) and bar(shown), "a relay that is gone is not told")
    with ExitStack() as closing, shown.expect_event("load"):
        closing.enter_context(served(port, files, relay))
        pass_time(shown)


def test_the_page_says_how_old_what_it_shows_is_and_whether_somebody_looks_back(
    files: tuple[str, int], shown: Page
) -> None:
    (port,) = free_ports(1)
    relay = Relay()
    with served(port, files, relay):
        with shown.expect_response("**/noctule/alive"):
            shown.goto(f"http://127.0.0.1:{port}/?url=x")
        drawn(shown, ago_s=5.0)
        for _ in range(2):  # the first was answered when it may have been asked before that
            shown.wait_for_event("response", lambda response: "noctule/alive" in response.url, timeout=1e3 * PATIENCE_S)
        assert told_of(shown, 5.0) == "", "it is old"
        late = r"What you see is (9\d|1[01]\d) s old: nothing is drawn any more, or this computer can't keep up\."
        wait_until(lambda: re.fullmatch(late, told_of(shown, 98.0)), "the page's age is not told")
        relay.drawn_s = time.time() + PATIENCE_S * 10
        wait_until(lambda: bar(shown).endswith("s old: this computer can't keep up."), "who is late is not told")
        shown.keyboard.press(" ")
        back = "You look back 2 h, or the page is late: the second button at the lower left follows the present."
        wait_until(lambda: told_of(shown, 7_300.0) == back, "who looks back is not told")
        assert colour(shown) == BLUE
        wait_until(lambda: told_of(shown, 1.0) == "", "a page that shows the present is called old")


def test_a_page_that_is_far_behind_loads_again_unless_somebody_looks_back(files: tuple[str, int], shown: Page) -> None:
    (port,) = free_ports(1)
    relay = Relay()
    shown.clock.install()
    with served(port, files, relay):
        shown.goto(f"http://127.0.0.1:{port}/?url=x")
        relay.drawn_s = time.time() + PATIENCE_S * 10
        shown.keyboard.press(" ")
        drawn(shown, ago_s=1_000.0)
        for _ in range(160):  # 320 s of the page's clock
            pass_time(shown)
        wait_until(lambda: pass_time(shown) and bar(shown).startswith("You look back"), "who looks back is not told")
        wait_until(lambda: pass_time(shown) and told_of(shown, 0.0) == "", "the present is not known")
        drawn(shown, ago_s=1_000.0)
        with shown.expect_event("load"):
            pass_time(shown)


def test_a_page_that_has_grown_too_large_loads_again_even_if_somebody_looks_back_but_not_just_after_it_was_opened(
    files: tuple[str, int], shown: Page
) -> None:
    (port,) = free_ports(1)
    shown.clock.install()
    with served(port, files, Relay()):
        open_and_look(shown, port)
        shown.evaluate(
            "window.noctuleHeap = { buffer: { byteLength: 3.1e9 } }"
        )  # three quarters of what a page can have
        shown.keyboard.press(" ")
        drawn(shown, ago_s=1_000.0)
        wait_until(lambda: pass_time(shown) and bar(shown).startswith("You look back"), "who looks back is not told")
        with shown.expect_event("load"):
            for _ in range(160):  # 320 s of the page's clock
                pass_time(shown)


def test_a_page_that_nobody_sees_is_not_called_old_and_loads_again_when_far_behind(
    files: tuple[str, int], shown: Page
) -> None:
    (port,) = free_ports(1)
    relay = Relay()
    shown.clock.install()
    with served(port, files, relay):
        open_and_look(shown, port)
        shown.evaluate("Object.defineProperty(document, 'hidden', { value: true })")
        for _ in range(60):  # two minutes
            pass_time(shown)
        # Where the server's answer is late, the bar says so until it comes.
        wait_until(lambda: pass_time(shown) and (bar(shown), shown.title()) == ("", "Noctule"), "it is called old")
        relay.drawn_s = time.time() + PATIENCE_S * 10
        with shown.expect_event("load"):
            for _ in range(120):
                pass_time(shown)


def test_the_page_says_when_nothing_comes_from_its_relay(files: tuple[str, int], shown: Page) -> None:
    (port,) = free_ports(1)
    shown.clock.install()
    with served(port, files, Relay()):
        open_and_look(shown, port)
        assert bar(shown) == ""
        begins = "Nothing has come from the relay for "
        wait_until(lambda: pass_time(shown) and bar(shown).startswith(begins), "an empty page is not told")


def test_a_stripe_and_the_title_say_what_is_wrong_now_also_on_a_page_that_is_behind(
    files: tuple[str, int], shown: Page
) -> None:
    (port,) = free_ports(1)
    relay, stripe = Relay(), shown.locator("#noctule-alarm")
    with served(port, files, relay):
        shown.goto(f"http://127.0.0.1:{port}/?url=x")
        wait_until(lambda: shown.title() == "Noctule", "a page without an alarm has another title")
        assert not stripe.is_visible()
        relay.troubles = ["attic \u2014 no mapper maps this site"]
        wait_until(lambda: stripe.is_visible() and shown.title() == f"\u26a0 {relay.troubles[0]}", "no alarm")
        drawn(shown, ago_s=98.0)
        wait_until(lambda: bar(shown).endswith(f" Now: {relay.troubles[0]}"), "a late page hides what is wrong now")
        relay.troubles = []
        wait_until(lambda: not stripe.is_visible(), "the alarm stays")


def test_an_address_that_names_no_relay_leads_to_the_servers_own(files: tuple[str, int], shown: Page) -> None:
    (port,) = free_ports(1)
    with served(port, files, Relay()):
        shown.goto(f"http://127.0.0.1:{port}/")
    assert shown.url == f"http://127.0.0.1:{port}/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A1%2Fproxy"
