"""A mapper whose router does not answer yet waits, and costs next to nothing; one on the bus says so at once."""

import socket
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from time import monotonic

import pytest
import zenoh
from mapper.live_site import paper_survey
from system.processes import PATIENCE_S, free_ports, wait_until

from noctule import bus, keys
from noctule.bus import StatePublisher
from noctule.client import Client
from noctule.messages_pb2 import Contour, ServiceStatus
from noctule.replay import Replay
from noctule.systemd import SOCKET_VARIABLE, ServiceManager
from noctule_mapper.live import service
from noctule_mapper.live.config import LiveConfig
from noctule_mapper.live.map_process import run_map
from noctule_mapper.live.nursery import Nursery
from noctule_mapper.live.service import LiveSettings, join, run
from noctule_mapper.sharing.last_contours import LastContours
from noctule_mapper.sharing.service import other_mappers


def test_it_asks_for_its_router_about_once_a_second(tmp_path: Path, monkeypatch) -> None:
    settings = LiveSettings("room", "mapper", tmp_path, ["tcp/127.0.0.1:9"], None, LiveConfig())
    stop = threading.Event()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard:
        heard.bind(str(tmp_path / "notify"))
        heard.settimeout(PATIENCE_S)
        monkeypatch.setenv(SOCKET_VARIABLE, str(tmp_path / "notify"))
        joining = threading.Thread(target=join, args=(settings, stop, ServiceManager()))
        began_s = monotonic()
        joining.start()
        for _ in range(3):
            assert b"no router answers at tcp/127.0.0.1:9" in heard.recv(4096)
        took_s = monotonic() - began_s
        stop.set()
        joining.join(PATIENCE_S)
    assert took_s >= 2.0 and service._JOIN_EVERY_S == 1.0
    assert not joining.is_alive()


def test_between_two_questions_for_its_router_it_ends_at_once_when_it_is_to(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(service, "_JOIN_EVERY_S", 10 * PATIENCE_S)
    settings = LiveSettings("room", "mapper", tmp_path, ["tcp/127.0.0.1:9"], None, LiveConfig())
    stop, told = threading.Event(), threading.Event()
    manager = ServiceManager()
    monkeypatch.setattr(manager, "waiting", lambda _: told.set())
    joining = threading.Thread(target=join, args=(settings, stop, manager))
    joining.start()
    assert told.wait(PATIENCE_S)
    stop.set()
    joining.join(PATIENCE_S)
    assert not joining.is_alive()


class NoSecondPasses(threading.Event):
    """Set or not set: no wait for it ends with its time-out."""

    def wait(self, timeout: float | None = None) -> bool:  # noqa: ARG002
        return super().wait()


def test_a_site_is_seen_to_be_mapped_before_the_second_in_which_statuses_come(tmp_path: Path) -> None:
    with on_a_bus(tmp_path) as router:
        wait_until(lambda: other_mappers(router, ["room"], but="") == {"room": "mapper"}, "not mapped")


LEFT = Contour(site="room", mapper="killed", version=41, sweeps=44, note="echoes from 2 places")


def test_the_heir_of_a_site_shows_its_last_contour_at_once_as_its_own_until_it_has_sweeps(tmp_path: Path) -> None:
    statuses = list[ServiceStatus]()
    with (
        on_a_bus(tmp_path, LEFT.SerializeToString(), threading.Event()) as router,
        Client("room", session=router) as client,
        closing(Replay(router, "room")) as replay,
    ):

        def sweeps_shown() -> int | None:
            return None if (contour := client.contour()) is None else contour.sweeps

        client.on_service_status(statuses.append)
        shown = wait_until(client.contour, "the last contour is not shown")
        assert (shown.mapper, shown.version) == ("mapper", 1)
        shown.mapper, shown.version = LEFT.mapper, LEFT.version
        assert shown == LEFT
        wait_until(lambda: statuses and statuses[-1].counters["contours"], "an empty map is not fitted")
        assert sweeps_shown() == LEFT.sweeps
        replay.run(paper_survey()[:3], speed=None)
        wait_until(lambda: sweeps_shown() == 3, "the last contour stays")


@pytest.mark.parametrize("left", [b"no contour", Contour(site="hall", sweeps=44).SerializeToString()])
def test_the_heir_of_a_site_shows_no_last_contour_that_is_none_or_of_another_site(tmp_path: Path, left: bytes) -> None:
    with on_a_bus(tmp_path, left, threading.Event()) as router, Client("room", session=router) as client:
        shown = wait_until(client.contour, "its own is not shown")
        assert (shown.site, shown.version, shown.sweeps) == ("room", 1, 0)


def test_the_last_contour_of_a_site_is_known_whether_it_came_before_or_later(sessions) -> None:
    before, later = (Contour(site="room", mapper="m1", version=version) for version in (1, 2))
    publisher = StatePublisher(sessions[0], keys.contour("room"), Contour)
    publisher.put(before)
    with closing(LastContours(sessions[1], ["room", "hall"])) as known:
        wait_until(lambda: known.of("room") == before.SerializeToString(), "the present contour is not known")
        publisher.put(later)
        wait_until(lambda: known.of("room") == later.SerializeToString(), "a new contour is not known")
        publisher.close()
        assert known.of("room") == later.SerializeToString()
        assert known.of("hall") == b""


@contextmanager
def on_a_bus(data: Path, last_contour: bytes = b"", stop: threading.Event | None = None) -> Iterator[zenoh.Session]:
    """The mapper of a site, and its router. The mapper publishes one status only where ``stop`` is left out."""
    (port,) = free_ports(1)
    nursery = Nursery(run_map)  # before there is a session
    with bus.open_session(listen=[f"tcp/127.0.0.1:{port}"]) as router:
        stop = stop or NoSecondPasses()
        where = ("room", "mapper", data, [f"tcp/127.0.0.1:{port}"], None, LiveConfig())
        mapping = threading.Thread(target=run, args=(LiveSettings(*where, last_contour=last_contour), stop, nursery))
        mapping.start()
        try:
            yield router
        finally:
            stop.set()
            mapping.join()
