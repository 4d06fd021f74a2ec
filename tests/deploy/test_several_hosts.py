"""A fleet whose hosts are apart: no network at the start, cut and lossy cables, power cuts. Nothing is lost."""

from pathlib import Path

import pytest
from deploy.several_hosts import ADDRESSES, DESK, DOMAIN, NO_ADDRESS, SITE, UNITS, SeveralHosts, several_hosts
from system.processes import ROOT
from system.site import SURVEY_SWEEPS
from truth import compare, load_room

from noctule.messages_pb2 import Contour

pytestmark = pytest.mark.usefixtures("can_have_namespaces")

GATEWAY, MAPPER, FAR_ROUTER = "noctule-gateway-attic", "noctule-mapper-cartographer", "noctule-router-one"
LACK = "no router answers"
PROGRAMS = ("router.one", "router.two", "gateway.attic", "mapper.cartographer")
PAPER_CORNER_ERROR_M = 0.0325  # Liu et al. 2019, Table II


def test_hosts_that_start_before_their_network_and_lose_it_again_lose_no_sweep_and_end_with_the_map(
    tmp_path: Path,
) -> None:
    with several_hosts(tmp_path) as hosts:
        start_without_network(hosts)
        cut_the_units_line(hosts)
        cut_off_the_mapper(hosts)
        cut_the_power_of_a_router(hosts)
        lose_packets(hosts)
        cut_the_power_of_the_gateway(hosts)
        break_a_router(hosts)

        hosts.wait_until(lambda: len(hosts.logged()) >= SURVEY_SWEEPS, "the survey is not in the gateway's log")
        all_is_stored(hosts)
        well = dict.fromkeys(PROGRAMS, "well")
        hosts.wait_until(lambda: hosts.states() == well, "not all are well", every_s=1.0)
        for router in (ADDRESSES["hub-1"], f"hub-2.{DOMAIN}"):
            hosts.wait_until(lambda router=router: sees_the_unit(hosts, router), f"{router} does not know the unit")
        contour = hosts.wait_until(lambda: of_all_sweeps(hosts), "no map rests on all sweeps", every_s=1.0)
        assert set(hosts.shut_down().values()) == {0}

        log_ids, sequences = map(list, zip(*hosts.logged(), strict=True))
        assert len(set(log_ids)) == 1
        assert sequences == list(range(1, len(sequences) + 1))
        assert hosts.stored() == hosts.logged()
        # What the unit has counted: it has handed over all that it made.
        assert hosts.sequences() == list(range(len(sequences)))

    comparison = compare(contour, load_room(ROOT / "firmware/simulator/rooms/paper.toml"))
    assert comparison.complete
    assert comparison.invented == 0
    assert comparison.mean_corner_error_m < PAPER_CORNER_ERROR_M


def start_without_network(hosts: SeveralHosts) -> None:
    """Services begin without address, carrier and name service, which come by and by."""
    for host in ADDRESSES:
        if host != DESK:
            hosts.boot(host)
    for service in (GATEWAY, MAPPER, FAR_ROUTER):
        word = NO_ADDRESS if service == FAR_ROUTER else LACK
        hosts.wait_until(lambda service=service, word=word: word in hosts.log(service), f"{service} notes no lack")
    for host in ADDRESSES:
        hosts.network.plug(host)
    hosts.wait_until(lambda: len(hosts.stored()) > 0, "no sweep is stored without a name service")
    for host in ADDRESSES:
        hosts.network.name(host, f"hub-2.{DOMAIN}")


def cut_the_units_line(hosts: SeveralHosts) -> None:
    """The unit sweeps on, and hands over later what it made meanwhile."""
    hosts.network.pull(UNITS)
    hosts.wait_until(lambda: "disconnected" in hosts.typed("noctule", "units", SITE).stdout, "the unit is not missed")
    before = len(hosts.logged())
    hosts.network.plug(UNITS)
    if before < SURVEY_SWEEPS:
        hosts.wait_until(lambda: len(hosts.logged()) > before, "the unit does not come back")
    another_sweep(hosts)


def cut_off_the_mapper(hosts: SeveralHosts) -> None:
    """It reads later what it has missed."""
    hosts.network.pull("server")
    another_sweep(hosts)
    hosts.network.plug("server")
    all_is_stored(hosts)


def cut_the_power_of_a_router(hosts: SeveralHosts) -> None:
    """All go on through the other, which they know by name alone."""
    hosts.cut_power("hub-1")
    another_sweep(hosts)
    all_is_stored(hosts)
    hosts.boot("hub-1")
    hosts.network.plug("hub-1")


def lose_packets(hosts: SeveralHosts) -> None:
    """The gateway's cable, which carries serial line and bus, loses packets."""
    hosts.network.spoil("attic-pi")
    another_sweep(hosts)
    all_is_stored(hosts)
    hosts.network.repair("attic-pi")


def cut_the_power_of_the_gateway(hosts: SeveralHosts) -> None:
    """The serial line's other end and the routers still hold the connections of before."""
    noted = hosts.log(GATEWAY).count(LACK)
    hosts.cut_power("attic-pi")
    hosts.boot("attic-pi")
    hosts.wait_until(lambda: hosts.log(GATEWAY).count(LACK) > noted, "the gateway notes no lack of a network")
    hosts.network.plug("attic-pi")
    another_sweep(hosts)
    all_is_stored(hosts)


def break_a_router(hosts: SeveralHosts) -> None:
    """It is started again, and nobody has to be."""
    hosts.crash("hub-2")
    another_sweep(hosts)
    all_is_stored(hosts)


def another_sweep(hosts: SeveralHosts) -> None:
    """Wait until one more sweep is logged; once the survey is over, have the operator order it."""
    before = len(hosts.logged())

    def logged() -> bool:
        if len(hosts.logged()) >= max(before, SURVEY_SWEEPS):
            hosts.typed("noctule", "rpc", SITE, "u1", "single")
        return len(hosts.logged()) > before

    hosts.wait_until(logged, "no sweep is logged any more")


def all_is_stored(hosts: SeveralHosts) -> None:
    """Wait until the mapper has all that the gateway has logged by now."""
    logged = set(hosts.logged())
    hosts.wait_until(lambda: logged <= set(hosts.stored()), "the mapper does not get what is logged")


def sees_the_unit(hosts: SeveralHosts, router: str) -> bool:
    """Whether the operator sees the unit through this router; the gateway is joined to one of the two."""
    seen = hosts.typed("noctule", "units", SITE, "--connect", f"tls/{router}:7447")
    return seen.returncode == 0 and "u1" in seen.stdout and "not served" not in seen.stdout


def of_all_sweeps(hosts: SeveralHosts) -> Contour | None:
    """The map, once it rests on every sweep that is stored."""
    contour = hosts.contour()
    return contour if contour is not None and contour.sweeps == len(hosts.stored()) else None
