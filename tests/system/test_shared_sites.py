"""Mappers that share sites: each site is mapped by one, and by another soon after that one is gone."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
import zenoh
from system.processes import Programs, free_ports, programs, wait_until

from noctule import bus, keys
from noctule.messages_pb2 import Contour
from noctule_mapper.sharing.rendezvous import owner_of
from noctule_mapper.sharing.service import other_mappers

SITES = [f"site-{number}" for number in range(6)]
SITE_WITH_A_UNIT = "site-3"
NAMES = ("m1", "m2", "m3")


@pytest.fixture(scope="module")
def endpoint() -> str:
    return f"tcp/127.0.0.1:{free_ports(1)[0]}"


@pytest.fixture(scope="module")
def router(endpoint: str) -> Iterator[zenoh.Session]:
    session = bus.open_session(listen=[endpoint])
    yield session
    session.close()


def start(running: Programs, folder: Path, endpoint: str, name: str) -> None:
    shared = [argument for site in SITES for argument in ("--site", site)]
    where = ("--data", str(folder / name), "--connect", endpoint, "--rerun", "none")
    running.start(name, "noctule-mapper", "share", "--name", name, *shared, *where)


def wait_for_owners(router: zenoh.Session, running: Programs, members: Sequence[str]) -> None:
    """Wait until every site is mapped by the member that the others expect to map it."""
    expected = {site: owner_of(site, members) for site in SITES}

    def mapped() -> bool:
        running.check()
        return other_mappers(router, SITES, but="") == expected

    wait_until(mapped, f"the sites are not mapped as {expected}")


def start_logged_unit(running: Programs, folder: Path, endpoint: str) -> None:
    """A unit whose log holds sweeps of a wall 1.5 m ahead, and comes to no end."""
    scan = folder / "wall.csv"
    scan.write_text("angle,range\n" + "".join(f"{angle},1.5\n" for angle in (-10, -5, 0, 5, 10)))
    columns = ("--angle", "angle", "--range", "range", "--units", "m")
    running.start("import", "noctule", "import", str(scan), *columns)
    assert running.wait("import") == 0, running.log("import")
    how = ("--site", SITE_WITH_A_UNIT, "--speed", "max", "--connect", endpoint)
    running.start("unit", "noctule", "replay", str(folder / "wall.jsonl"), *how)


def swept(router: zenoh.Session) -> int:
    """Sweeps in the contour of the site with a unit; 0 where nobody publishes one."""
    replies = router.get(keys.contour(SITE_WITH_A_UNIT))
    return max((Contour.FromString(reply.ok.payload.to_bytes()).sweeps for reply in replies if reply.ok), default=0)


def test_sites_of_a_killed_mapper_are_mapped_by_the_others_with_all_that_was_logged_and_come_back_to_it(
    tmp_path: Path, endpoint: str, router: zenoh.Session
) -> None:
    owner = owner_of(SITE_WITH_A_UNIT, NAMES)
    assert owner is not None
    others = [name for name in NAMES if name != owner]
    with programs(tmp_path) as running:
        start_logged_unit(running, tmp_path, endpoint)
        for name in NAMES:
            start(running, tmp_path, endpoint, name)
        wait_for_owners(router, running, NAMES)
        held = wait_until(lambda: swept(router), "no contour of the unit's sweeps")
        running.kill(owner)
        wait_for_owners(router, running, others)
        wait_until(lambda: swept(router) >= held, "the heir has not what the killed one had")
        start(running, tmp_path, endpoint, owner)
        wait_for_owners(router, running, NAMES)
        wait_until(lambda: swept(router) >= held, "the one that is back has not what it had")
        for name in NAMES:
            assert running.end(name) == 0, running.log(name)
