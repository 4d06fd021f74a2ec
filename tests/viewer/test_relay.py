"""The relay as people get it: its page, its layout, its word on the bus, and its end."""

import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.request import urlopen

import psutil
import pytest
from mapper.rerun_relay import Viewer
from mapper.rerun_relay import viewer as late_joiner
from system.processes import PATIENCE_S, Programs, free_ports, listens, programs, wait_until
from viewer.relay_rig import (
    run_viewer,
    start_relay,
)

from noctule import bus, keys, rerun_paths
from noctule.client import Client
from noctule.messages_pb2 import ServiceStatus, UnitStatus


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Programs]:
    with programs(tmp_path) as made:
        yield made


def viewer_processes(running: Programs) -> list[psutil.Process]:
    """The command that this test has started, and the relay below it."""
    command = psutil.Process(running.pid("viewer"))
    return [command, *command.children(recursive=True)]


def processor_s(processes: list[psutil.Process]) -> float:
    return sum(sum(process.cpu_times()[:2]) for process in processes)


def test_one_address_is_printed_and_opens_the_page(running: Programs) -> None:
    relay = start_relay(running)
    (line,) = wait_until(lambda: re.findall("^Watch the map at (.*)$", running.log("viewer"), re.M), "no address")
    assert line == relay.page
    with urlopen(line) as page:
        assert b"<title>Rerun Viewer</title>" in page.read()
    running.end("viewer")
    assert not listens(relay.port)
    assert not listens(relay.web_port)


def test_the_relay_shows_on_the_bus_of_its_site_how_it_is_and_which_mapper_has_another_rerun(running: Programs) -> None:
    (port,) = free_ports(1)
    endpoint = f"tcp/127.0.0.1:{port}"
    start_relay(running, "--site", "house", "--connect", endpoint)  # it does not wait for the router
    with bus.open_session(listen=[endpoint]) as session, Client("house", session=session) as client:
        got: list[ServiceStatus] = []
        client.on_service_status(got.append)
        wait_until(lambda: got and not got[-1].detail, "no status came that says that all is well")
        assert (got[-1].site, got[-1].name, got[-1].role) == ("house", "viewer", "viewer")
        publisher = bus.StatePublisher(session, keys.service_status("house", "old"), ServiceStatus)

        def told() -> bool:
            publisher.put(ServiceStatus(site="house", name="old", role="mapper", rerun="0.40.2"))
            return got[-1].detail.startswith(f"old draws with 0.40.2, and this relay is Rerun {got[0].rerun}: install")

        wait_until(told, "a mapper with another Rerun is not told", every_s=0.5)
        publisher.put(ServiceStatus(site="house", name="old", role="mapper", rerun=got[0].rerun))
        wait_until(lambda: got[-1].detail == "", "a mapper with the same Rerun gets a warning")
        publisher.put(ServiceStatus(site="house", name="old", role="mapper", rerun_recording="sites"))
        takes_off = "what old draws is not seen here, because this page shows one site: take #sites off its --rerun"
        wait_until(lambda: got[-1].detail == takes_off, "a mapper that draws for a page of several sites is not told")
        publisher.put(ServiceStatus(site="house", name="old", role="mapper", rerun_recording="house"))
        wait_until(lambda: got[-1].detail == "", "a mapper that draws for this page gets a warning")
        publisher.close()
        running.end("viewer")


def test_a_unit_that_appears_on_a_watched_site_comes_into_alarms_and_table_and_gets_its_tab(
    running: Programs, tmp_path: Path
) -> None:
    (port,) = free_ports(1)
    endpoint = f"tcp/127.0.0.1:{port}"
    with bus.open_session(listen=[endpoint]) as session:
        relay = start_relay(running, "--site", "house", "--connect", endpoint)
        with late_joiner(relay.url, tmp_path) as watching:
            wait_for_text(watching, rerun_paths.ALARMS, "no mapper maps this site")
            token = session.liveliness().declare_token(keys.alive("house", "u1"))
            publisher = bus.StatePublisher(session, keys.unit_status("house", "u1"), UnitStatus)
            stuck = UnitStatus(site="house", unit="u1", state=UnitStatus.STATE_FAULT, detail="it is stuck")

            def again() -> None:
                publisher.put(stuck)  # a gateway that is silent for ten seconds is away

            wait_for_text(watching, rerun_paths.UNITS_TABLE, ": fault: it is stuck", again)
            wait_for_text(watching, rerun_paths.unit_sheet("u1"), "### u1 — needs attention", again)
            wait_until(lambda: "u1" in watching.names_in_layouts(), "no tab")
            token.undeclare()
            publisher.close()
            wait_for_text(watching, rerun_paths.ALARMS, "1 of 1 unit needs attention: u1: no gateway serves it")
        running.end("viewer")


def wait_for_text(watching: Viewer, path: str, words: str, meanwhile: Callable[[], None] = lambda: None) -> None:
    def said() -> bool:
        meanwhile()
        return any(words in text for (text,) in watching.values(path, "TextDocument:text"))

    wait_until(said, f"{path} does not say {words!r}", every_s=0.5)


def test_an_idle_relay_leaves_the_processor_alone(running: Programs) -> None:
    start_relay(running)
    wait_until(lambda: "Watch the map" in running.log("viewer"), "no address")
    tree = viewer_processes(running)
    # A busy process beside it gets what a busy relay would get, however loaded the machine is: with a layout file as
    # its source Rerun 0.41 was as busy as that.
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy:
        try:
            before_s, beside = processor_s(tree), [psutil.Process(busy.pid)]
            wait_until(lambda: processor_s(beside) > 1.5, "nothing gets the processor")
            took_s, busy_s = processor_s(tree) - before_s, processor_s(beside)
        finally:
            busy.kill()
    assert took_s < busy_s / 3


def test_a_viewer_that_comes_late_gets_the_layout_once_and_no_empty_recording(
    running: Programs, tmp_path: Path
) -> None:
    relay = start_relay(running)
    with late_joiner(relay.url, tmp_path) as watching:
        layout = wait_until(watching.layouts, "no layout")
        assert layout == [rerun_paths.APPLICATION_ID]
        assert watching.seen() == {}


def test_the_relay_ends_with_the_command_that_started_it_even_if_that_is_killed(running: Programs) -> None:
    relay = start_relay(running)
    command, process = viewer_processes(running)
    command.kill()
    wait_until(lambda: not process.is_running(), "the relay lives on")
    assert not listens(relay.port)


def test_a_relay_that_dies_ends_the_command_with_its_status(running: Programs) -> None:
    start_relay(running)
    command, process = viewer_processes(running)
    process.kill()
    assert command.wait(PATIENCE_S) == 128 + signal.SIGKILL
    assert "the relay ended by itself, with status -9" in running.log("viewer")


def test_a_port_that_is_taken_is_named(running: Programs) -> None:
    relay = start_relay(running)
    second = run_viewer("run", "--port", str(relay.port), "--web-port", str(relay.web_port))
    assert second.returncode == 1
    said = f"can't listen on 127.0.0.1:{relay.port}: port {relay.port} is in use by rerun (process "
    assert said in second.stderr and "stop that, or name another port" in second.stderr
