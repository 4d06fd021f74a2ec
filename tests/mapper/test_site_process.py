"""The process above a site's mapper: it kills one that hangs, and none that was stopped together with itself. All fits
pause for a site that it takes over.
"""

import os
import signal
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from pathlib import Path

import psutil
import pytest
import zenoh
from mapper.live_site import SITE, live_site
from system.processes import PATIENCE_S, ROOT, Programs, free_ports, programs, wait_until
from system.test_shared_operations import maps_a_site

from noctule import keys
from noctule.bus import StatePublisher
from noctule.logs import LogFormat
from noctule.messages_pb2 import ServiceStatus
from noctule_mapper.live.config import LiveConfig
from noctule_mapper.live.service import LiveSettings
from noctule_mapper.sharing import service
from noctule_mapper.sharing.offers import Offers
from noctule_mapper.sharing.site_process import SILENCE, SILENT_S, SiteProcess, forking_context

HANGS_AFTER_S, NEVER_S = 15.0, 1e6  # fifteen pings: a disk may keep a sound one for six
KILLED = "it is killed"


def processes(running: Programs) -> list[psutil.Process]:
    """The program, what it forks from, and what was forked."""
    program = psutil.Process(running.pid("keeper"))
    return [program, *program.children(recursive=True)]


def test_a_pause_of_all_processes_kills_no_mapper_and_a_mapper_that_alone_is_stopped_is_replaced(
    tmp_path: Path,
) -> None:
    with live_site(tmp_path) as site:
        arguments = (SITE, str(tmp_path / "data"), site.endpoint, str(HANGS_AFTER_S), str(NEVER_S))
        env = {"PYTHONPATH": str(ROOT / "tests")}
        site.running.start("keeper", sys.executable, "-m", "mapper.one_site", *arguments, env=env)

        def starts() -> int:
            site.running.check()
            return site.running.log("keeper").count(f"maps site {SITE}")

        said: list[ServiceStatus] = []
        site.client.on_service_status(said.append)
        wait_until(lambda: starts() == 1 and len(said) > 2, "no mapper that makes progress")
        keeper, *others = processes(site.running)
        for each in (keeper, *others):
            each.suspend()
        time.sleep(HANGS_AFTER_S + 1.0)  # tried here is that this time does not count
        keeper.resume()
        time.sleep(1.0)  # so that it looks some times before the mapper can say anything
        for each in others:
            each.resume()
        before = len(said)
        wait_until(lambda: len(said) > before + 2, "the mapper says nothing after the pause")
        assert starts() == 1
        assert KILLED not in site.running.log("keeper")

        next(filter(maps_a_site, processes(site.running))).suspend()
        before = len(said)
        wait_until(lambda: starts() == 2 and len(said) > before + 1, "the mapper that hangs is not replaced")
        assert site.running.log("keeper").count(KILLED) == 1


def test_fits_pause_for_a_takeover_and_for_no_site_that_another_maps_or_that_failed(sessions, tmp_path: Path) -> None:
    paused, other = tmp_path / "fit-pause", StatePublisher(sessions[1], keys.service_status(SITE, "m2"), ServiceStatus)
    other.put(ServiceStatus(site=SITE, name="m2", role="mapper"))
    nobody = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    settings = LiveSettings(SITE, "m1", tmp_path / SITE, [nobody], None, LiveConfig())
    with (
        closing(Offers(sessions[0], "m1", [SITE], threading.Event())) as offers,
        ThreadPoolExecutor(1) as starts,
        ExitStack() as ending,
    ):
        site = SiteProcess(settings, LogFormat.TEXT, forking_context())
        ending.callback(lambda: site.wait(time.monotonic() + PATIENCE_S))
        ending.callback(site.end)

        def maps() -> int | None:
            service._step([site], offers, sessions[0], "m1", starts, tmp_path)
            return site.pid

        wait_until(lambda: service.other_mappers(sessions[0], [SITE], but="m1") == {SITE: "m2"}, "m2 is not known")
        assert maps() is None
        assert not paused.exists()
        other.close()
        pid = wait_until(maps, "the site is not taken over")
        assert paused.exists()
        paused.unlink()
        os.kill(pid, signal.SIGKILL)
        wait_until(lambda: maps() not in (None, pid), "the site's mapper is not started again")
        assert site.failed == 1
        assert not paused.exists()


def test_a_site_of_which_nobody_says_in_time_whether_it_is_mapped_waits_and_not_for_ever(
    sessions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second of silence was taken for the answer that nobody maps it."""
    monkeypatch.setattr(service, "_QUERY_TIMEOUT_S", 0.1)
    key, kept = keys.service_status(SITE, "hangs"), list[zenoh.Query]()
    sessions[1].declare_queryable(key, kept.append)
    wait_until(
        lambda: service.other_mappers(sessions[0], [SITE], but="m1") == {SITE: SILENCE}, "it is taken for nobody"
    )
    settings = LiveSettings(SITE, "m1", tmp_path / SITE, [], None, LiveConfig())
    site = SiteProcess(settings, LogFormat.TEXT, forking_context())
    answers = [(SILENCE, 0.0), (SILENCE, SILENT_S - 0.1), (None, SILENT_S), (SILENCE, 9.0), ("m2", 10.0)]
    answers += [(SILENCE, 11.0), (SILENCE, 10.9 + SILENT_S), (SILENCE, 11.0 + SILENT_S)]
    free = [site._is_free(other, now_s) for other, now_s in answers]
    assert free == [False, False, True, False, False, False, False, True]


def test_a_mapper_that_hangs_as_it_begins_is_replaced(tmp_path: Path) -> None:
    with programs(tmp_path) as running:
        nobody = f"tcp/127.0.0.1:{free_ports(1)[0]}"
        arguments = (SITE, str(tmp_path / "data"), nobody, str(NEVER_S), str(HANGS_AFTER_S))
        env = {"PYTHONPATH": str(ROOT / "tests")}
        running.start("keeper", sys.executable, "-m", "mapper.one_site", *arguments, env=env)

        def log() -> str:
            running.check()
            return running.log("keeper")

        wait_until(lambda: "waiting for it" in log(), "no mapper that waits for its router")
        time.sleep(HANGS_AFTER_S + 1.0)  # to wait is not to hang
        assert KILLED not in log()
        next(filter(maps_a_site, processes(running))).suspend()
        wait_until(lambda: log().count(f"maps site {SITE}") == 2, "the mapper that hangs is not replaced")
        assert log().count(KILLED) == 1
