"""How long a site's mapper has made no progress, by what it sends; the protocol is sd_notify(3)."""

from collections.abc import Iterator
from contextlib import closing

import pytest

from noctule.systemd import ServiceManager
from noctule_mapper.sharing.heartbeat import LONGEST_LOOK_S, Heartbeat


@pytest.fixture
def heartbeat(monkeypatch: pytest.MonkeyPatch) -> Iterator[Heartbeat]:
    with closing(Heartbeat()) as listening:
        monkeypatch.setenv("NOTIFY_SOCKET", listening.address)
        yield listening


def test_a_mapper_that_waits_for_its_router_is_not_silent_however_long_it_waits(heartbeat: Heartbeat) -> None:
    heartbeat.begin(1000.0)
    for second in range(1001, 1400):
        ServiceManager().waiting("no router")
        assert heartbeat.silent_s(float(second)) == 0.0


def test_a_mapper_that_hangs_as_it_begins_is_silent_from_its_start_on(heartbeat: Heartbeat) -> None:
    heartbeat.begin(1000.0)
    assert [heartbeat.silent_s(1000.0 + 0.5 * look) for look in range(1, 63)][-1] == 31.0
    assert not heartbeat.is_ready


def test_a_mapper_that_is_ready_makes_no_progress_by_waiting(heartbeat: Heartbeat) -> None:
    manager = ServiceManager()
    manager.serving("all is well")
    assert heartbeat.silent_s(1000.0) == 0.0 and heartbeat.is_ready
    manager.waiting("no router")
    assert heartbeat.silent_s(1000.5) == 0.5


def test_a_mapper_that_makes_no_progress_is_silent_from_its_last_ping_on(heartbeat: Heartbeat) -> None:
    manager = ServiceManager()
    manager.serving("all is well")
    assert heartbeat.silent_s(1000.0) == 0.0
    manager.serving("hangs", progress=False)
    assert [heartbeat.silent_s(1000.0 + 0.5 * look) for look in range(1, 63)][-1] == 31.0
    manager.serving("all is well")
    assert heartbeat.silent_s(1032.0) == 0.0


def test_a_pause_of_both_processes_counts_once_and_not_in_full(heartbeat: Heartbeat) -> None:
    ServiceManager().serving("all is well")
    heartbeat.silent_s(1000.0)
    assert heartbeat.silent_s(1000.5) == 0.5
    assert heartbeat.silent_s(9000.0) == 0.5 + LONGEST_LOOK_S
    assert heartbeat.silent_s(9000.5) == 1.0 + LONGEST_LOOK_S


def test_what_the_process_before_has_sent_is_forgotten(heartbeat: Heartbeat) -> None:
    manager = ServiceManager()
    manager.serving("all is well")
    heartbeat.silent_s(1000.0)
    manager.serving("all is well")
    heartbeat.begin(1001.0)
    assert (heartbeat.silent_s(1001.5), heartbeat.is_ready) == (0.5, False)
