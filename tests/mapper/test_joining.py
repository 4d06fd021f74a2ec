"""A mapper whose router does not answer yet waits, and costs next to nothing; one on the bus says so at once."""

import socket
import threading
from pathlib import Path

from system.processes import free_ports, wait_until

from noctule import bus
from noctule.systemd import SOCKET_VARIABLE, ServiceManager
from noctule_mapper.live.config import LiveConfig
from noctule_mapper.live.map_process import run_map
from noctule_mapper.live.nursery import Nursery
from noctule_mapper.live.service import LiveSettings, join, run
from noctule_mapper.sharing.service import other_mappers


def test_it_asks_for_its_router_about_once_a_second_and_ends_at_once_when_it_is_to(tmp_path: Path, monkeypatch) -> None:
    settings = LiveSettings("room", "mapper", tmp_path, ["tcp/127.0.0.1:9"], None, LiveConfig())
    stop = threading.Event()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard:
        heard.bind(str(tmp_path / "notify"))
        heard.settimeout(20)
        monkeypatch.setenv(SOCKET_VARIABLE, str(tmp_path / "notify"))
        joining = threading.Thread(target=join, args=(settings, stop, ServiceManager()))
        joining.start()
        for _ in range(2):
            assert b"no router answers at tcp/127.0.0.1:9" in heard.recv(4096)
        heard.settimeout(0.5)  # the next is not due for a second
        try:
            told_again = heard.recv(4096)
        except TimeoutError:
            told_again = b""
        stop.set()
        joining.join(2)
    assert told_again == b""
    assert not joining.is_alive()


class NoSecondPasses(threading.Event):
    """Set or not set: no wait for it ends with its time-out."""

    def wait(self, timeout: float | None = None) -> bool:  # noqa: ARG002
        return super().wait()


def test_a_site_is_seen_to_be_mapped_before_the_second_in_which_statuses_come(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    nursery = Nursery(run_map)  # before there is a session
    with bus.open_session(listen=[f"tcp/127.0.0.1:{port}"]) as router:
        stop = NoSecondPasses()
        settings = LiveSettings("room", "mapper", tmp_path, [f"tcp/127.0.0.1:{port}"], None, LiveConfig())
        mapping = threading.Thread(target=run, args=(settings, stop, nursery))
        mapping.start()
        try:
            wait_until(lambda: other_mappers(router, ["room"], but="") == {"room": "mapper"}, "not mapped", within_s=60)
        finally:
            stop.set()
            mapping.join()
