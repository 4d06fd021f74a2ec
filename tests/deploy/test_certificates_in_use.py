"""docs/pages/years.md rehearsed: certificates are renewed and revoked while the programs that use them run."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from deploy.mapper_store import stored_sweeps
from deploy.secured_fleet import SecuredFleet, rendered
from deploy.test_upgrade import wait_for_the_unit
from deploy.test_years import ran
from system.processes import programs, wait_until
from system.site import SURVEY_SWEEPS, paper_room

from noctule import bus
from noctule.client import Client
from noctule.messages_pb2 import Contour

SWEEPS = SURVEY_SWEEPS + 3


@pytest.mark.soak
def test_certificates_of_running_programs_are_renewed_and_revoked_and_no_sweep_is_lost(tmp_path: Path) -> None:
    fleet, room = rendered(tmp_path), paper_room(tmp_path)
    site = tmp_path / "site.toml"
    site.write_text(site.read_text().replace('site = "paper-room"', 'site = "house"'))
    data, maps = tmp_path / "gateway", tmp_path / "mapper"
    gateway = ("noctule-gateway", "run", str(site), "--data", str(data), "--tls")
    mapper = ("noctule-mapper", "run", "--site", "house", "--data", str(maps), "--rerun", "none", "--tls")
    with programs(tmp_path) as running, routers(fleet) as start_again:

        def change(command: str, subject: str) -> None:
            ran("noctule-deploy", command, subject, fleet.file, "--out", fleet.place.out, "--ca", fleet.place.ca)
            start_again()

        def use(program: str, command: tuple[str, ...], common_name: str) -> None:
            if running.runs(program):
                assert running.end(program) == 0, running.log(program)
            running.start(program, *command, str(fleet.folder(common_name)))

        def wait_for_stored(count: int) -> None:
            def enough() -> bool:
                running.check()
                return stored_sweeps(maps / "house.sqlite3") >= count

            wait_until(enough, f"fewer than {count} sweeps are stored")

        def another_sweep(count: int) -> None:
            with fleet.join("operator.anna.g1") as session, Client("house", session=session) as client:
                wait_for_the_unit(client)
            ran("noctule", "rpc", "house", "u1", "single", "--tls", fleet.folder("operator.anna.g1"))
            wait_for_stored(count)

        running.start("simulator", *room.simulator(speed=24))
        use("gateway", gateway, "gateway.attic.g1")
        use("mapper", mapper, "mapper.cartographer.g1")
        wait_for_stored(SURVEY_SWEEPS)

        change("renew", "gateway.attic")
        change("renew", "mapper.cartographer")
        another_sweep(SURVEY_SWEEPS + 1)  # the certificates in use are still admitted
        use("gateway", gateway, "gateway.attic.g2")
        use("mapper", mapper, "mapper.cartographer.g2")
        wait_until(lambda: "gateway.attic.g2 says" in running.log("gateway"), "the gateway is not on the bus")
        another_sweep(SURVEY_SWEEPS + 2)

        change("revoke", "gateway.attic")
        wait_until(lambda: "this certificate was revoked" in running.log("gateway"), "it is not refused")
        use("gateway", gateway, "gateway.attic.g3")
        wait_until(lambda: "gateway.attic.g3 says" in running.log("gateway"), "the gateway is not on the bus again")
        another_sweep(SWEEPS)

        with fleet.join("operator.anna.g1") as session, Client("house", session=session) as client:
            contour = wait_until(lambda: whole(client.contour()), "no contour of all sweeps")
            log = client.log("u1", from_sequence=1)
        for program in ("mapper", "gateway", "simulator"):
            assert running.end(program) == 0, running.log(program)

    assert log is not None
    assert len({sweep.log_id for sweep in log.sweeps}) == 1
    assert [sweep.log_sequence for sweep in log.sweeps] == list(range(1, SWEEPS + 1))
    assert [sweep.sequence for sweep in log.sweeps] == list(range(SWEEPS))
    assert stored_sweeps(maps / "house.sqlite3") == SWEEPS
    assert (len(contour.walls), len(contour.corners), len(contour.cylinders)) == (5, 5, 1)
    ran("noctule-deploy", "check", fleet.file, "--out", fleet.place.out, "--ca", fleet.place.ca)


@contextmanager
def routers(fleet: SecuredFleet) -> Iterator[Callable[[], None]]:
    """Both routers run; what is yielded starts them again, one after the other, as their folders are now."""
    with ExitStack() as one, ExitStack() as two:
        both = {"router.one.g1": one, "router.two.g1": two}

        def start_again() -> None:
            for name, router in both.items():
                router.close()
                router.enter_context(bus.open_session(tls_folder=fleet.folder(name)))

        start_again()
        yield start_again


def whole(contour: Contour | None) -> Contour | None:
    """The contour, if it rests on all sweeps."""
    return contour if contour is not None and contour.sweeps >= SWEEPS else None
