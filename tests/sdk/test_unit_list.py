"""Which rows `noctule units` shows, from what is on the bus and from the site file."""

from pathlib import Path

import pytest

from noctule.messages_pb2 import Cursor, ServiceStatus, UnitFault, UnitStatus
from noctule.site import Site, load
from noctule.unit_list import NO_STATUS, is_well, rows

SITE = """
site = "room"
[[unit]]
name = "u1"
serial = 1
address = "socket://127.0.0.1:1"
pose = { x_m = 0.0, y_m = 0.0, heading_deg = 0 }
[[unit]]
name = "u2"
serial = 2
address = "socket://127.0.0.1:2"
pose = { x_m = 0.0, y_m = 0.0, heading_deg = 0 }
"""


@pytest.fixture
def site(tmp_path: Path) -> Site:
    path = tmp_path / "site.toml"
    path.write_text(SITE)
    return load(path)


def status(unit: str, gateway: str, detail: str = "") -> UnitStatus:
    return UnitStatus(site="room", unit=unit, gateway=gateway, detail=detail)


def test_a_unit_that_two_gateways_serve_has_a_row_for_each() -> None:
    found = rows({"u1"}, [status("u1", "west"), status("u1", "east")], [], None)
    assert [(row.unit, row.status and row.status.gateway) for row in found] == [("u1", "east"), ("u1", "west")]


def test_a_unit_of_the_site_file_that_nobody_serves_is_shown(site: Site) -> None:
    served, missing = rows({"u1"}, [status("u1", "east")], [], site)
    assert (served.unit, served.served, served.detail) == ("u1", True, "")
    assert (missing.unit, missing.served, missing.detail) == ("u2", False, "no gateway serves it")


def test_a_unit_that_is_not_in_the_site_file_is_said_to_be_a_stranger(site: Site) -> None:
    found = {row.unit: row.detail for row in rows({"u9"}, [status("u9", "east", detail="no answer")], [], site)}
    assert found["u9"] == "not in the site file; no answer"


def test_a_unit_that_was_there_before_is_shown_with_its_last_sweep() -> None:
    late = Cursor(unit="u3", log_id="a", log_sequence=17)
    late.time.FromSeconds(1_000_000)
    early = Cursor(unit="u3", log_id="a", log_sequence=16)
    early.time.FromSeconds(900_000)
    services = [ServiceStatus(name="mapper", cursors=[late]), ServiceStatus(name="archive", cursors=[early])]
    (row,) = rows(set(), [], services, None)
    assert (row.unit, row.served, row.since_ns, row.swept_ns) == ("u3", False, *[1_000_000 * 10**9] * 2)
    assert row.detail == "no gateway serves it any more; mapper has read its log to 17"


def test_a_served_unit_is_shown_with_its_last_sweep_also_where_its_gateway_has_just_been_started() -> None:
    read = Cursor(unit="u1", log_id="a", log_sequence=17)
    read.time.FromSeconds(1_000_000)
    services = [ServiceStatus(name="mapper", cursors=[read])]
    logged = status("u1", "east")
    logged.last_sweep.FromSeconds(1_000_005)
    found = rows({"u1"}, [logged, status("u1", "west")], services, None)
    assert [row.swept_ns for row in found] == [1_000_005 * 10**9, 1_000_000 * 10**9]


def test_a_unit_whose_gateway_gives_no_status_is_served_all_the_same() -> None:
    (row,) = rows({"u1"}, [], [], None)
    assert (row.served, row.status, row.detail) == (True, None, NO_STATUS)


def test_a_status_says_since_when_the_unit_answers() -> None:
    told = status("u1", "east")
    told.since.FromSeconds(5)
    (row,) = rows({"u1"}, [told], [], None)
    assert row.since_ns == 5 * 10**9


@pytest.mark.parametrize("state", UnitStatus.State.values())
def test_a_unit_is_well_that_works_and_of_which_nothing_is_told(state: UnitStatus.State) -> None:
    works = UnitStatus(unit="u1", state=state)
    told = UnitStatus(unit="u1", state=state, detail="the log is full")
    faulty = UnitStatus(unit="u1", state=state, faults=[UnitFault()])
    unwell = ("UNSPECIFIED", "DISCONNECTED", "WAITING", "FAULT", "LOADER")
    expected = UnitStatus.State.Name(state).removeprefix("STATE_") not in unwell
    assert [is_well(row) for status in (works, told, faulty) for row in rows({"u1"}, [status], [], None)] == [
        expected,
        False,
        False,
    ]
    assert [is_well(row) for row in rows({"u1"}, [], [], None)] == [False]
