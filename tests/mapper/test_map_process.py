"""The process of the map beside its service: killed, hung, and left behind."""

import signal
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from mapper.live_site import SITE, LiveSite, live_site, paper_survey
from system.processes import wait_until

from noctule.messages_pb2 import ServiceStatus

_HANGS_SOON = """
import sys
from noctule_mapper.cli import main
from noctule_mapper.live import remote_map

remote_map._SILENT_AFTER = 15
main(sys.argv[1:])
"""


@pytest.fixture
def site(tmp_path: Path) -> Iterator[LiveSite]:
    with live_site(tmp_path) as made:
        yield made


def of_the_map(site: LiveSite) -> tuple[psutil.Process, psutil.Process]:
    """The nursery, and the process that it has forked."""

    def both() -> tuple[psutil.Process, psutil.Process] | None:
        tree = psutil.Process(site.running.pid("mapper")).children(recursive=True)
        return (tree[0], tree[1]) if len(tree) == 2 else None

    return wait_until(both, "the mapper has no process for its map")


def has_ended(process: psutil.Process) -> bool:
    try:
        return process.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def test_a_map_process_that_is_killed_or_hangs_is_named_and_started_again_and_no_sweep_is_lost(
    site: LiveSite, tmp_path: Path
) -> None:
    statuses: list[ServiceStatus] = []
    site.client.on_service_status(statuses.append)
    where = ("--site", SITE, "--data", str(tmp_path), "--connect", site.endpoint, "--rerun", "none")
    site.running.start("mapper", "python", "-c", _HANGS_SOON, "run", *where)
    survey = paper_survey()[:9]
    site.play(survey[:3])
    version = site.contour_of(3).version
    for restarts, (number, end) in enumerate(((signal.SIGKILL, 6), (signal.SIGSTOP, 9)), start=1):
        _, map_process = of_the_map(site)
        since = len(statuses)
        map_process.send_signal(number)
        site.play(survey[end - 3 : end])  # into the store, though there is no map
        wait_until(
            lambda since=since: any("the map's process ended with -9" in one.detail for one in statuses[since:]),
            "the status does not say it",
        )
        contour = site.contour_of(end)
        assert contour.version > version
        version = contour.version
        wait_until(lambda: "the map's process" not in statuses[-1].detail, "the status still says it")
        assert statuses[-1].counters["map_restarts"] == restarts
    assert statuses[-1].counters["contours"] >= 3
    # Its process tells its figures each second.
    wait_until(lambda: statuses[-1].counters["map_memory_bytes"] > 1e6, "no memory of the map's process")
    wait_until(lambda: statuses[-1].counters["map_cpu_ms"] > 0, "no processor time of the map's process")
    assert site.running.log("mapper").count("the map's process hangs: it is killed") == 1
    assert site.running.end("mapper") == 0


@pytest.mark.parametrize("killed", ["the mapper", "the nursery"])
def test_a_map_process_ends_with_its_mapper_even_where_it_hangs(site: LiveSite, killed: str) -> None:
    site.start_mapper()
    site.play(paper_survey()[:1])
    site.contour_of(1)
    nursery, map_process = of_the_map(site)
    map_process.suspend()
    if killed == "the mapper":
        psutil.Process(site.running.pid("mapper")).kill()
        assert site.running.wait("mapper") == -signal.SIGKILL
    else:
        nursery.kill()
        assert site.running.wait("mapper") == 70
        assert "the process that the map's is forked from is gone" in site.running.log("mapper")
    wait_until(lambda: has_ended(nursery) and has_ended(map_process), "it has left processes behind")
