"""What the status makes of what is heard on the bus: a row for each program, and how it fares."""

from datetime import UTC, datetime, timedelta
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console
from system.processes import free_ports

from noctule.messages_pb2 import ServiceStatus
from noctule_deploy import fleet_file, pages, status
from noctule_deploy.cli.status_table import show
from noctule_deploy.errors import RenderError
from noctule_deploy.fleet import Fleet, Web
from noctule_deploy.generations import Generations
from noctule_deploy.render import Place
from noctule_deploy.status import Heard, Row, State

NOW = datetime(2026, 3, 1, tzinfo=UTC)
HASHED = "$2b$04$abcdefghijklmnopqrstuubKjiNwI71ul7nETs8D9Wbpfd3CpQAoS"  # bcrypt at its least cost
LATER = NOW + timedelta(days=400)
SITE = 'site = "house"\n[[unit]]\nname = "u1"\nserial = 1\naddress = "/dev/ttyUSB0"\npose = "key"\n'
FLEET = """
router = [{ name = "one", address = "pi" }, { name = "two", address = "hub", host = "hub" }]
gateway = [
    { name = "attic", site = "house", units = ["u1"], host = "pi", site_file = "house.toml", router = "one" },
    { name = "barn", site = "farm", units = ["u1"] },
]
mapper = [{ name = "m1", sites = ["*"], host = "hub" }, { name = "m2", sites = ["*"], host = "spare" }]
operator = [{ name = "anna", sites = ["house"] }, { name = "berta", sites = ["farm", "house"] }]
viewer = [{ name = "screen", sites = ["*"], host = "hub", web = { name = "map.example", users = { anna = "HASHED" } } }]
""".replace("HASHED", HASHED)
PAGES = {"screen": ""}


@pytest.fixture
def fleet(tmp_path: Path) -> Fleet:
    """Two sites that two mappers share; the first gateway is the first router."""
    (tmp_path / "house.toml").write_text(SITE)
    (tmp_path / "fleet.toml").write_text(FLEET)
    return fleet_file.load(tmp_path / "fleet.toml")


def said(site: str, name: str, detail: str = "", age_s: float = 1.0) -> ServiceStatus:
    message = ServiceStatus(site=site, name=name, version="0.1.0", detail=detail)
    message.time.FromDatetime(NOW - timedelta(seconds=age_s))
    return message


ALL_WELL = (
    said("house", "one"),
    said("farm", "barn"),
    said("house", "m1"),
    said("farm", "m2"),
    said("house", "screen"),
)


def rows(fleet: Fleet, *services: ServiceStatus, expires: dict[str, datetime] | None = None) -> dict[str, Row]:
    every = {subject: LATER for subject in fleet.subjects()} | (expires or {})
    return {
        row.program: row for row in status.rows(fleet, Heard(frozenset({"one", "two"}), services, PAGES), every, NOW)
    }


def test_each_program_has_a_row_under_its_host(fleet: Fleet) -> None:
    found = rows(fleet, *ALL_WELL)
    assert {name: row.host for name, row in found.items()} == {
        "router.one": "pi",
        "gateway.attic": "pi",  # its name on the bus is the router's, whose certificate it has
        "router.two": "hub",
        "mapper.m1": "hub",
        "viewer.screen": "hub",
        "web.screen": "hub",
        "mapper.m2": "spare",
        "gateway.barn": "",
    }
    assert {row.state for row in found.values()} == {State.WELL}
    assert found["mapper.m2"].site == "farm"


def test_what_says_nothing_what_has_said_it_long_ago_and_what_complains_are_told_apart(fleet: Fleet) -> None:
    others = [each for each in ALL_WELL if each.name not in ("barn", "screen", "m1")]
    found = rows(fleet, *others, said("house", "m1", age_s=16.0), said("house", "screen", "the relay does not answer"))
    assert (found["gateway.barn"].state, found["gateway.barn"].detail) == (State.AWAY, "says nothing")
    assert found["mapper.m1"].state is State.OLD
    assert (found["viewer.screen"].state, found["viewer.screen"].detail) == (State.ALARM, "the relay does not answer")


def test_a_router_that_does_not_answer_is_away(fleet: Fleet) -> None:
    found = status.rows(fleet, Heard(frozenset({"one"}), ALL_WELL, PAGES), {}, NOW)
    assert {row.program: row.state for row in found if row.state is not State.WELL} == {"router.two": State.AWAY}


def test_a_service_of_another_site_with_the_same_name_is_not_taken_for_it(fleet: Fleet) -> None:
    others = [each for each in ALL_WELL if each.name != "barn"]
    assert rows(fleet, *others, said("house", "barn"))["gateway.barn"].state is State.AWAY


def test_a_certificate_that_expires_within_30_days_shows_where_all_else_is_well(fleet: Fleet) -> None:
    soon = NOW + timedelta(days=30)
    found = rows(fleet, *ALL_WELL, expires={"mapper.m1": soon, "router.one": soon})
    expiring = {name for name, row in found.items() if row.state is State.EXPIRES}
    assert expiring == {"mapper.m1", "router.one", "gateway.attic"}
    assert rows(fleet, expires={"mapper.m1": soon})["mapper.m1"].state is State.AWAY


def test_the_bus_is_asked_with_an_operators_certificate_that_may_read_all_sites(fleet: Fleet, tmp_path: Path) -> None:
    place = Place(tmp_path / "rendered", tmp_path / "ca")
    known = {"operator.anna": Generations(1, 1), "operator.berta": Generations(2, 3)}
    assert status.own_folder(fleet, place, known) == place.out / "operator.berta.g3"
    with pytest.raises(RenderError, match=r"no operator who may read all sites: name a certificate's folder \(--tls\)"):
        status.own_folder(fleet, place, {"operator.anna": Generations(1, 1)})
    with pytest.raises(RenderError, match="no certificates yet: run noctule-deploy render"):
        status.own_folder(fleet, place, {})


def shown(found: dict[str, Row], width: int, is_terminal: bool) -> list[str]:
    written = StringIO()
    show(list(found.values()), Console(file=written, width=width, force_terminal=is_terminal, color_system=None))
    return written.getvalue().splitlines()


def test_the_table_fits_a_terminal_of_80_columns_and_no_word_of_it_is_cut(fleet: Fleet) -> None:
    complaint = "install chrony, and let the host reach a time server, " * 8 + "now"
    found = rows(fleet, said("house", "one", complaint), *ALL_WELL[1:])
    lines = shown(found, 80, is_terminal=True)
    assert max(map(len, lines)) <= 80
    assert all(any(f" {program} " in line for line in lines) for program in found)
    assert f"gateway.attic (house): {complaint}" in " ".join(line.strip() for line in lines)
    (row,) = [line for line in shown(found, 80, is_terminal=False) if "gateway.attic" in line]
    assert complaint in row, "what is piped on has all of a program in its line"


def test_a_page_that_does_not_answer_is_away(fleet: Fleet) -> None:
    (port,) = free_ports(1)
    web = Web.model_validate({"name": "127.0.0.1", "port": port, "users": {"anna": HASHED}})
    trouble = pages.trouble(web)
    assert trouble.startswith(f"https://127.0.0.1:{port} does not answer: ")
    found = status.rows(fleet, Heard(frozenset(), (), {"screen": trouble}), {}, NOW)
    (row,) = [row for row in found if row.program == "web.screen"]
    assert (row.host, row.state, row.detail) == ("hub", State.AWAY, trouble)
