"""The process above a site's mapper: it kills one that hangs, and none that was stopped together with itself."""

import sys
import time
from pathlib import Path

import psutil
from mapper.live_site import SITE, live_site
from system.processes import ROOT, Programs, free_ports, programs, wait_until
from system.test_shared_operations import maps_a_site

from noctule.messages_pb2 import ServiceStatus

HANGS_AFTER_S, NEVER_S = 6.0, 1e6  # six pings
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
