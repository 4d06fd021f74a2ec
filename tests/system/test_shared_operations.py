"""A mapper that shares sites as it is run in production: scraped, notified to systemd, and ended whatever hangs."""

import time
from contextlib import suppress
from pathlib import Path

import psutil
from system.processes import Programs, programs, wait_until
from system.test_one_owner import gateway
from system.test_operations import ENDED_WITHIN_S, metrics_address, read_all, scrape, systemd, wait_for_line

SITES = ("attic", "hall")


def start(running: Programs, folder: Path, env: dict[str, str]) -> None:
    router = gateway(folder, folder / "router")
    running.start("router", *router)
    shared = [argument for site in SITES for argument in ("--site", site)]
    where = ("--data", str(folder / "maps"), "--connect", router[-1], "--rerun", "none")
    more = ("--metrics", "127.0.0.1:0", "--log-format", "json")
    running.start("share", "noctule-mapper", "share", "--name", "m1", *shared, *where, *more, env=env)


def test_one_page_has_the_figures_of_every_site_and_a_site_that_hangs_does_not_delay_the_end(
    tmp_path: Path,
) -> None:
    with programs(tmp_path) as running, systemd(tmp_path) as (receiver, env):
        start(running, tmp_path, env)
        wait_for_line(receiver, "READY=1")
        wait_for_line(receiver, "WATCHDOG=1")
        address = metrics_address(running, "share")

        def sites_shown() -> dict[str, str]:
            found = scrape(address).get("noctule_build_info", [])
            return {labels["site"]: labels["service"] for labels, _ in found if labels["role"] == "mapper"}

        wait_until(lambda: sites_shown() == {"attic": "m1", "hall": "m1"}, "not all sites are shown")
        found = scrape(address)
        assert found["noctule_share_sites_mapped"] == [({"site": "", "service": "m1"}, 2.0)]
        assert found["noctule_share_sites_unshared"] == [({"site": "", "service": "m1"}, 0.0)]
        memory = {labels["site"]: value for labels, value in found["noctule_site_process_resident_memory_bytes"]}
        assert memory.keys() == set(SITES)
        assert min(memory.values()) > 1e6

        def maps_with_cpu() -> set[str]:
            found = scrape(address).get("noctule_mapper_map_cpu_seconds", [])
            return {labels["site"] for labels, value in found if value > 0}

        wait_until(lambda: maps_with_cpu() == set(SITES), "not each map's process has a figure")
        # Frozen as by a disk that hangs: it hears no SIGTERM.
        (hung, _) = [each for each in tree(running) if maps_a_site(each)]
        hung.suspend()
        try:
            read_all(receiver)
            others, began_s = tree(running), time.monotonic()
            psutil.Process(running.pid("share")).terminate()
            assert running.wait("share") == 0
            wait_until(lambda: not any(map(works, others)), "it has left processes behind", within_s=ENDED_WITHIN_S)
            assert time.monotonic() - began_s < ENDED_WITHIN_S
            wait_for_line(receiver, "STOPPING=1")
            assert running.log("share").count("does not end: it is killed; nothing stored is lost") == 1
        finally:
            with suppress(psutil.NoSuchProcess):
                hung.kill()


def tree(running: Programs) -> list[psutil.Process]:
    return psutil.Process(running.pid("share")).children(recursive=True)


def works(process: psutil.Process) -> bool:
    """It has not ended; one that has may wait for the system to take note of it."""
    try:
        return process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def maps_a_site(process: psutil.Process) -> bool:
    """Those that the fork server has forked; it and the resource tracker are children of the program itself. What such
    a process has forked is of its map.
    """
    by_fork_server = [any("forkserver" in part for part in each.cmdline()) for each in process.parents()]
    return by_fork_server.count(True) == 1
