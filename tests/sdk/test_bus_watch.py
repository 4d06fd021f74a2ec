"""Whether what a service publishes is read back, also while others write on the same key."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
from sdk.conftest import Router
from system.processes import wait_until

from noctule import bus, keys
from noctule.bus import StatePublisher
from noctule.bus_watch import BusWatch
from noctule.messages_pb2 import ServiceStatus

FLOOD = 120_000


class FloodedReader:
    """The second connection, on which a stranger's states come first, so many at once as no test can publish."""

    def __init__(self, own: StatePublisher) -> None:
        self.own: StatePublisher | None = own

    def __enter__(self) -> "FloodedReader":
        return self

    def __exit__(self, *_: object) -> None:
        self.own = None

    def declare_subscriber(self, _: str, callback: Callable[[Any], None]) -> None:
        for number in range(FLOOD):
            callback(_sample(keys.service_status("room", "busy"), b"%d" % number))
        threading.Thread(target=self._pass_on, args=(callback,), daemon=True).start()

    def _pass_on(self, callback: Callable[[Any], None]) -> None:
        pause = threading.Event()
        while (own := self.own) is not None and not pause.wait(0.01):
            if own.last is not None:
                callback(_sample(own.key, own.last))


def _sample(key: str, payload: bytes) -> Any:
    return SimpleNamespace(key_expr=key, payload=SimpleNamespace(to_bytes=lambda: payload))


@contextmanager
def publishing(session: Any) -> Iterator[StatePublisher]:
    """A service that publishes another state ten times a second."""
    state = StatePublisher(session, keys.service_status("room", "busy"), ServiceStatus)
    ending = threading.Event()

    def publish() -> None:
        number = 0
        while not ending.wait(0.1):
            state.put(ServiceStatus(site="room", name="busy", counters={"states": (number := number + 1)}))

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        yield state
    finally:
        ending.set()
        thread.join()
        state.close()


def test_a_service_whose_key_a_stranger_floods_is_read_all_the_same(
    router: Router, monkeypatch: pytest.MonkeyPatch
) -> None:
    with bus.open_session([router.endpoint]) as session, publishing(session) as state:
        watch = BusWatch(session, [router.endpoint])
        monkeypatch.setattr(bus, "open_session", lambda *_, **__: FloodedReader(state))
        watch.begin(lambda: [state])
        wait_until(watch.looked.is_set, "the watch does not look")
        assert watch.detail() == ""
        watch.close()


def test_a_service_that_nobody_can_read_is_told_so(router: Router, monkeypatch: pytest.MonkeyPatch) -> None:
    with bus.open_session([router.endpoint]) as session, publishing(session) as state:
        watch = BusWatch(session, [router.endpoint])
        nobody = StatePublisher(session, keys.service_status("room", "nobody"), ServiceStatus)
        monkeypatch.setattr(bus, "open_session", lambda *_, **__: FloodedReader(nobody))
        watch.begin(lambda: [state])
        wait_until(watch.looked.is_set, "the watch does not look")
        assert watch.detail().startswith("nobody reads what is published on noctule/@v1/room/service/busy/status: ")
        watch.close()
