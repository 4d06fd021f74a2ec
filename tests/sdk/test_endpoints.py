"""Endpoints that are not there: own addresses that come later, routers that are dead."""

import logging
import re
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from sdk.conftest import Router
from system.processes import free_ports, wait_until

from noctule import bus, endpoints
from noctule.bus_watch import BusWatch
from noctule.errors import BusConfigError, BusError

# In a network of its own, where it may give itself an address.
ADDRESS_COMES_LATER = """
import logging, subprocess, time
from noctule import bus, endpoints
from noctule.bus_watch import BusWatch
from noctule.ending import leave

def ip(*arguments):
    subprocess.run(["ip", *arguments], check=True)

def wait_until(condition):
    deadline_s = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline_s, watch.detail()
        time.sleep(0.05)

logging.basicConfig(level=logging.INFO)
ip("link", "set", "lo", "up")
endpoints = ["tcp/10.9.9.9:7447", "tcp/127.0.0.1:7447"]
with bus.open_session(listen=endpoints) as router:
    bus.open_session(endpoints[1:], patience_s=60).close()
    watch = BusWatch(router, listen=endpoints)
    watch.begin(tuple)
    wait_until(lambda: "not listening on tcp/10.9.9.9:7447: this host does not have that address yet" in watch.detail())
    ip("addr", "add", "10.9.9.9/24", "dev", "lo")
    bus.open_session(endpoints[:1], patience_s=60).close()
    wait_until(lambda: "not listening" not in watch.detail())
    watch.close()
leave(0)  # as every program does: the interpreter's end is no place for Zenoh's threads
"""


def test_an_address_that_comes_later_is_listened_on_then_and_the_others_at_once() -> None:
    command = ["unshare", "--map-root-user", "--net", sys.executable, "-c", ADDRESS_COMES_LATER]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
    assert done.returncode == 0, done.stderr
    assert "this host does not have the address of tcp/10.9.9.9:7447 yet: waiting for it" in done.stderr


@contextmanager
def watched(connect: list[str], listen: list[str]) -> Iterator[Callable[[str], None]]:
    """A function that waits until the watch of a session says just what is given."""
    with bus.open_session(connect, listen) as session:
        watch = BusWatch(session, connect, listen)
        watch.begin(tuple)

        def wait_for(detail: str) -> None:
            wait_until(lambda: watch.detail() == detail, f"the watch does not say {detail!r}")

        try:
            yield wait_for
        finally:
            watch.close()


@pytest.mark.parametrize("listen", [["tcp/127.0.0.1:0"], []])
def test_a_dead_router_is_named_in_status_and_log_until_it_answers(
    router: Router, listen: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    dead = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    told = f"router {dead}: nothing listens there; start it, or name another"
    with caplog.at_level(logging.INFO), watched([dead, router.endpoint], listen) as wait_for:
        wait_for(told)
        assert told in caplog.text
        other = Router(dead)
        wait_for("")
        other.stop()


@contextmanager
def silent(port: int) -> Iterator[None]:
    """On the port a connection neither comes about nor is refused: the queue of those that wait is full."""
    with socket.socket() as listening, socket.socket() as waiting:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(("127.0.0.1", port))
        listening.listen(0)
        waiting.connect(("127.0.0.1", port))
        yield


def test_a_dead_router_with_two_faults_in_turn_is_logged_once_with_each(
    router: Router, caplog: pytest.LogCaptureFixture
) -> None:
    """As a host that is off: now there is no answer, now no route to it."""
    (port,) = free_ports(1)
    told = f"router tcp/127.0.0.1:{port}: "
    with caplog.at_level(logging.INFO), watched([f"tcp/127.0.0.1:{port}", router.endpoint], []) as wait_for:
        for _ in range(2):
            wait_for(f"{told}nothing listens there; start it, or name another")
            with silent(port):
                wait_for(f"{told}can't be reached (no answer); start it, or name another")
    assert caplog.text.count(told) == 2


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ("http://x", "'http://x' is no endpoint: write tcp/HOST:PORT"),
        ("10.0.0.7:7447", "'10.0.0.7:7447' is no endpoint: write tcp/HOST:PORT"),
        ("tcp/127.0.0.1", "tcp/127.0.0.1 has no port: write tcp/HOST:PORT"),
        ("tls/router-1:", "tls/router-1: has no port: write tls/HOST:PORT"),
        ("tcp/127.0.0.1:99999", "tcp/127.0.0.1:99999: port 99999 is none: give 1 to 65535"),
    ],
)
def test_an_endpoint_that_makes_no_sense_is_refused_at_once_in_words(written: str, told: str) -> None:
    with pytest.raises(BusConfigError, match=f"^{re.escape(told)}$"):
        bus.open_session([written])  # it would wait for ever for a router


@pytest.mark.parametrize("written", ["tcp/[::1]:7447", "tls/router-1:7447?rel=0#iface=eth0", "unixsock-stream//run/z"])
def test_an_endpoint_that_zenoh_can_use_is_left_to_it(written: str) -> None:
    assert endpoints.fault(written) == ""


def test_a_host_that_nobody_knows_is_no_matter_of_certificates() -> None:
    with pytest.raises(BusError, match=r"^no router answers: tcp/nowhere\.invalid:7447: no host is known"):
        bus.open_session(["tcp/nowhere.invalid:7447"], patience_s=0.0)
