"""Nothing phones home: relay, native viewer, SDK and the page in a browser ask for no other host."""

import io
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mapper.rerun_relay import relay as grpc_relay
from PIL import Image
from playwright.sync_api import Browser, sync_playwright
from system.processes import PATIENCE_S, Programs, free_ports, listens, programs, wait_until
from viewer.browser import CHROMIUM, SHOWN_WITHIN_S, SOFTWARE_GL
from viewer.far_hosts import asked, refusing_proxy, traced
from viewer.relay_rig import CYLINDER, log_room, middle_row, start_relay

from noctule_viewer.relay import RERUN, environment

WATCHED_S = 5.0  # Rerun's analytics ask for their host within a second of the second start
# Chromium would ask this host on behalf of the page's context, whatever the page is.
NO_AUTOFILL = "--disable-features=AutofillServerCommunication"
DRAWING = """
import sys
from system.processes import wait_until
from noctule_mapper.rerun_view.log import RerunLog
log = RerunLog(sys.argv[1], "paper-room")
log.show_event("hello")
wait_until(lambda: log.counters()["rerun_drawn"] == 1, "nothing was drawn")
log.close()
"""


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Programs]:
    with programs(tmp_path) as made:
        yield made


def home(folder: Path) -> dict[str, str]:
    """The environment of a user who has never run Rerun before the test."""
    return {"HOME": str(folder), "XDG_CONFIG_HOME": str(folder / ".config"), "DISPLAY": ""}


def watch(running: Programs, name: str) -> str:
    """Let a program that is up run on for a while, end it, and return what it has printed."""
    time.sleep(WATCHED_S)  # nothing marks the end of what is not to happen
    running.end(name)
    return running.log(name)


def test_the_relay_asks_for_no_host_at_its_first_start_nor_later_and_prints_its_address_only(
    running: Programs, tmp_path: Path
) -> None:
    for start in ("first", "second"):
        trace = tmp_path / f"{start}.trace"
        port, web_port = free_ports(2)
        ports = ["--port", str(port), "--web-port", str(web_port)]
        running.start(start, *traced(trace), "noctule-viewer", "run", *ports, env=home(tmp_path))
        wait_until(lambda name=start: "Watch the map" in running.log(name), "no address")
        assert len(watch(running, start).splitlines()) == 1
        assert asked(trace) == []


def test_the_native_viewer_asks_for_no_host(running: Programs, tmp_path: Path) -> None:
    with grpc_relay() as far_end:
        far_end.start()
        for start in ("first", "second"):
            trace = tmp_path / f"{start}.trace"
            (port,) = free_ports(1)
            command = [str(RERUN), far_end.url, "--headless", "--bind", "127.0.0.1", "--port", str(port)]
            running.start(start, *traced(trace), *command, env=environment() | {"HOME": str(tmp_path)})
            wait_until(lambda port=port: listens(port), "the viewer does not listen")
            watch(running, start)
            assert asked(trace) == []


def test_what_draws_on_the_relay_asks_for_no_host(tmp_path: Path) -> None:
    with grpc_relay() as far_end:
        far_end.start()
        for start in ("first", "second"):
            trace = tmp_path / f"{start}.trace"
            command = [*traced(trace), sys.executable, "-c", DRAWING, far_end.url]
            subprocess.run(command, env=os.environ | home(tmp_path) | {"PYTHONPATH": "tests"}, check=True)
            assert asked(trace) == []
            assert f"htons({far_end.port})" in trace.read_text(), "the trace does not even show the relay"


@pytest.fixture
def browser() -> Iterator[tuple[Browser, str, list[str]]]:
    """A browser, the proxy for its pages, and what was asked of the proxy. Its own requests go to another one."""
    with refusing_proxy() as (own, _), refusing_proxy() as (proxy, requests), sync_playwright() as playwright:
        flags = ["--no-sandbox", NO_AUTOFILL, *SOFTWARE_GL]
        patience_ms = 1e3 * PATIENCE_S
        with playwright.chromium.launch(
            executable_path=CHROMIUM, args=flags, proxy={"server": own}, timeout=patience_ms
        ) as made:
            yield made, proxy, requests


def test_the_page_shows_the_map_and_asks_for_no_host(
    running: Programs, browser: tuple[Browser, str, list[str]]
) -> None:
    chromium, proxy, requests = browser
    relay = start_relay(running)
    log_room(relay)
    size, through = {"width": 640, "height": 400}, {"server": proxy, "bypass": "127.0.0.1"}
    page = chromium.new_context(viewport=size, proxy=through).new_page()  # pyright: ignore[reportArgumentType]
    page.set_default_timeout(1e3 * SHOWN_WITHIN_S)
    page.goto(f"{relay.page}&renderer=webgl")

    def shows_cylinder() -> bool:
        picture = np.array(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))
        return middle_row(picture, CYLINDER) is not None

    wait_until(shows_cylinder, "the page does not show the map", SHOWN_WITHIN_S, every_s=1.0)
    assert requests == []
