"""A mapper whose router does not answer yet: it waits, and costs next to nothing while it does."""

import socket
import threading
from pathlib import Path

from noctule.systemd import SOCKET_VARIABLE, ServiceManager
from noctule_mapper.live.config import LiveConfig
from noctule_mapper.live.service import LiveSettings, join


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
