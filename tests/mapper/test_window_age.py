"""Ages in the mapper's window: time that has passed, and never the time between two settings of a clock."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from sdk.host_clocks import DAY_S, NOON_S, Host

from noctule.checksum import checksum
from noctule.messages_pb2 import READING_STATUS_NO_ECHO, Cursor, Pose, Sweep
from noctule.survey import Record
from noctule_mapper.config import Window
from noctule_mapper.live.store import SweepStore
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.sweep import from_message
from noctule_mapper.survey_fit import map_survey
from noctule_mapper.window import windowed

DAY = Window(max_age_s=DAY_S)
LOG = "8c1f"


def sweep(number: int, start_s: float, epoch: str = "", unit: str = "u1") -> Sweep:
    """The ``number``th sweep of a unit's log, from a place of its own."""
    made = Sweep(site="s", unit=unit, log_id=f"{LOG} of {unit}", log_sequence=number, clock_epoch=epoch)
    made.pose.CopyFrom(Pose(x_m=number, sigma_position_m=0.01))
    made.start.FromNanoseconds(round(start_s * 1e9))
    made.readings.add(status=READING_STATUS_NO_ECHO)
    return made


def sequences(store: SweepStore) -> list[int]:
    return [held.log_sequence for held in store.sweeps()]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "s.sqlite3"


def made_while_the_clock_is_set(set_s: float, marked: bool) -> list[Sweep]:
    """Ten sweeps, ten seconds apart; the gateway's clock is set after the fifth."""
    return [
        sweep(number, NOON_S + 10 * number + (set_s if number > 5 else 0.0), f"epoch {number > 5}" if marked else "")
        for number in range(1, 11)
    ]


@pytest.mark.parametrize("marked", [True, False], ids=["marked", "of an earlier gateway"])
@pytest.mark.parametrize("set_s", [14 * DAY_S, -14 * DAY_S])
def test_a_gateways_clock_that_is_set_by_two_weeks_takes_no_sweep_from_a_live_map(
    path: Path, set_s: float, marked: bool
) -> None:
    host = Host()
    host.pass_time(max(set_s, 0.0))  # the mapper's clock agrees with the later of the two: no time is in its future
    store = SweepStore(path, DAY, host)
    for made in made_while_the_clock_is_set(set_s, marked):
        store.commit([made], [])
        host.pass_time(10.0)
    assert sequences(store) == list(range(1, 11))
    store.close()
    reopened = SweepStore(path, DAY, host)
    assert sequences(reopened) == list(range(1, 11))
    reopened.close()


@pytest.mark.parametrize("marked", [True, False], ids=["marked", "of an earlier gateway"])
@pytest.mark.parametrize("set_s", [14 * DAY_S, -14 * DAY_S])
def test_a_gateways_clock_that_is_set_by_two_weeks_takes_no_sweep_from_a_file(set_s: float, marked: bool) -> None:
    surveyed = map_survey(
        Record("survey", number, made)
        for number, made in enumerate(made_while_the_clock_is_set(set_s, marked), start=1)
    )
    assert (len(surveyed.mapper.sweeps()), surveyed.left_out) == (10, ())


@pytest.mark.parametrize("set_s", [14 * DAY_S, -14 * DAY_S])
def test_a_mappers_own_clock_that_is_set_by_two_weeks_removes_nothing(path: Path, set_s: float) -> None:
    host = Host()
    store = SweepStore(path, DAY, host)
    for number in range(1, 11):
        store.commit([sweep(number, NOON_S + 10 * number, "one")], [])
        host.pass_time(10.0)
        host.utc_s += set_s if number == 5 else 0.0
    store.set_aside((f"{LOG} of u1", 10), "a bug")
    host.utc_s -= set_s
    store.set_aside((f"{LOG} of u1", 9), "a bug")
    assert sequences(store) == list(range(1, 9))
    assert len(store.sweeps_set_aside()) == 2
    store.close()


def test_sweeps_leave_when_they_have_been_in_the_store_for_longer_whatever_their_times_say(path: Path) -> None:
    host = Host()
    store = SweepStore(path, DAY, host)
    store.commit([sweep(1, NOON_S)], [])
    host.pass_time(0.6 * DAY_S)
    store.commit([sweep(2, NOON_S)], [])
    host.pass_time(0.6 * DAY_S)
    assert store.commit([sweep(3, NOON_S)], []).left == ((f"{LOG} of u1", 1),)
    assert sequences(store) == [2, 3]
    store.close()


def test_of_a_backlog_read_at_once_leaves_what_is_too_old_by_the_times_of_one_epoch(path: Path) -> None:
    backlog = [sweep(number, NOON_S + number * 0.4 * DAY_S, "one") for number in range(1, 6)]
    host = Host()
    host.pass_time(2 * DAY_S)
    store = SweepStore(path, DAY, host)
    store.commit(backlog, [])
    assert sequences(store) == [3, 4, 5]
    store.close()
    assert windowed(backlog, DAY, round(host.utc_s * 1e9)).left == {0: "too old", 1: "too old"}


def test_units_of_one_gateway_are_in_one_epoch_and_age_together(path: Path) -> None:
    store = SweepStore(path, DAY, Host())
    store.commit([sweep(1, NOON_S - 3 * DAY_S, "one", "u1"), sweep(1, NOON_S - 3 * DAY_S, "other", "u2")], [])
    store.commit([sweep(1, NOON_S, "one", "u3")], [])
    assert [held.unit for held in store.sweeps()] == ["u2", "u3"]
    store.close()


def test_age_goes_on_over_restarts_and_a_reboot_ages_nothing(path: Path) -> None:
    host = Host()

    def kept_after(number: int) -> list[int]:
        store = SweepStore(path, DAY, host)
        store.commit([sweep(number, host.utc_s, f"boot {host.boots}")], [])
        held = sequences(store)
        store.close()
        return held

    assert kept_after(1) == [1]
    host.pass_time(0.6 * DAY_S)  # the mapper is down, the host runs
    assert kept_after(2) == [1, 2]
    host.boot(off_s=400 * DAY_S)
    assert kept_after(3) == [1, 2, 3]
    host.pass_time(0.6 * DAY_S)
    assert kept_after(4) == [2, 3, 4]


def test_a_map_is_made_again_in_the_order_in_which_its_sweeps_came(path: Path) -> None:
    """A clock set back by two weeks: by their times, the sweeps that came last would come first."""
    made = made_while_the_clock_is_set(-14 * DAY_S, marked=True)
    store = SweepStore(path, DAY, Host())
    for one in made:
        store.commit([one], [])
    store.close()
    reopened = SweepStore(path, DAY, Host())
    assert reopened.sweeps() == made
    reopened.close()


def test_a_contour_bears_the_time_of_the_newest_sweep_of_the_present_epoch() -> None:
    mapper = Mapper()
    for made in made_while_the_clock_is_set(-14 * DAY_S, marked=True):
        mapper.register_sweep(from_message(made))
    assert mapper.contour().time_s == NOON_S + 100 - 14 * DAY_S


SCHEMA_3 = """
CREATE TABLE sweep (
    unit TEXT NOT NULL, log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL,
    start_ns INTEGER NOT NULL, visit INTEGER NOT NULL,
    place_x_m REAL NOT NULL, place_y_m REAL NOT NULL, place_heading_rad REAL NOT NULL,
    record BLOB NOT NULL, checksum BLOB NOT NULL,
    PRIMARY KEY (unit, log_id, log_sequence));
CREATE INDEX sweep_by_age ON sweep (start_ns);
CREATE INDEX sweep_by_place ON sweep (unit, place_x_m, place_y_m, place_heading_rad);
CREATE TABLE cursor (
    unit TEXT PRIMARY KEY, log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL, checksum BLOB NOT NULL);
CREATE TABLE set_aside (
    log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL, unit TEXT NOT NULL, at_ns INTEGER NOT NULL,
    reason TEXT NOT NULL, record BLOB NOT NULL, checksum BLOB NOT NULL,
    PRIMARY KEY (log_id, log_sequence));
CREATE TABLE contour (version INTEGER NOT NULL, checksum BLOB NOT NULL);
PRAGMA user_version = 3;
"""
SCHEMA_2 = SCHEMA_3.replace(", checksum BLOB NOT NULL", "").replace("version = 3", "version = 2")


def write_before(path: Path, schema: str, sweeps: list[Sweep]) -> None:
    """A store as the versions before left it: the sweeps, one more set aside, a cursor, seven contours."""

    def row(*values: object) -> tuple[object, ...]:
        return (*values, checksum(*values)) if schema is SCHEMA_3 else values

    with closing(sqlite3.connect(path)) as database, database:
        database.executescript(schema)

        def insert(table: str, *values: object) -> None:
            marks = ", ".join("?" * len(row(*values)))
            database.execute(f"INSERT INTO {table} VALUES ({marks})", row(*values))

        for one in sweeps:
            start_ns = one.start.ToNanoseconds()
            place = (one.pose.x_m, one.pose.y_m, one.pose.heading_rad)
            record = one.SerializeToString()
            insert("sweep", one.unit, one.log_id, one.log_sequence, start_ns, one.log_sequence, *place, record)
        insert("set_aside", f"{LOG} of u1", 99, "u1", round(NOON_S * 1e9), "a bug", b"")
        insert("cursor", "u1", f"{LOG} of u1", 100)
        insert("contour", 7)


@pytest.mark.parametrize("schema", [SCHEMA_2, SCHEMA_3], ids=["version 2", "version 3"])
def test_a_store_of_a_version_before_loses_nothing_and_ages_from_now(path: Path, schema: str) -> None:
    host, before = Host(), [sweep(number, NOON_S - 29 * DAY_S * number) for number in (1, 2, 3)]
    write_before(path, schema, before)
    for _ in range(2):
        store = SweepStore(path, DAY, host)
        assert (store.damage, store.sweeps()) == ("", before)
        assert store.cursors() == {"u1": Cursor(unit="u1", log_id=f"{LOG} of u1", log_sequence=100)}
        assert store.sweeps_set_aside() == [("u1", (f"{LOG} of u1", 99), "a bug")]
        store.close()
    host.pass_time(0.9 * DAY_S)
    store = SweepStore(path, DAY, host)
    assert store.next_contour_version() == 8
    store.commit([sweep(4, NOON_S)], [])
    assert sequences(store) == [1, 2, 3, 4]
    host.pass_time(0.2 * DAY_S)
    store.commit([sweep(5, NOON_S)], [])
    assert sequences(store) == [4, 5]
    store.close()


def test_a_damaged_sweep_in_a_store_of_the_version_before_gets_no_checksum_of_its_own(path: Path) -> None:
    write_before(path, SCHEMA_3, [sweep(number, NOON_S) for number in (1, 2, 3)])
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE sweep SET place_x_m = 70 WHERE log_sequence = 2")
    store = SweepStore(path, DAY, Host())
    assert "1 rows of its table sweep do not fit" in store.damage
    assert sequences(store) == [1, 3]
    assert store.sweeps_set_aside() == [("u1", (f"{LOG} of u1", 99), "a bug")]
    store.close()


def test_contours_of_a_store_damaged_again_and_again_bear_new_numbers_also_where_the_clock_stands_in_1970(
    path: Path,
) -> None:
    host, borne = Host(), [0]
    for utc_s in (NOON_S, 100.0, 100.0):
        host.utc_s = utc_s
        store = SweepStore(path, DAY, host)
        assert (borne[-1] > 0) == ("table contour do not fit" in store.damage)
        borne += [store.next_contour_version() for _ in range(3)]
        store.close()
        with closing(sqlite3.connect(path)) as database, database:
            database.execute("UPDATE contour SET version = 77")
    assert borne == sorted(set(borne))
    assert borne[-1] < 2**53  # bounds.py: beyond, a double no longer counts
