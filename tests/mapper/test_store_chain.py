"""The chain over the rows of the mapper's store: a row that is gone, or that was never committed, shows."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from mapper.stored_sweeps import LOG, cursor, sequences, sweep

from noctule_mapper.config import Window
from noctule_mapper.live.store import SweepStore
from noctule_mapper.readings.faulty import Suspect


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "paper-room.sqlite3"


SWEEP_2 = "DELETE FROM sweep WHERE log_sequence = 2"


@pytest.mark.parametrize(
    ("table", "statements", "left"),
    [
        ("sweep", [SWEEP_2], [1]),
        ("sweep", ["DELETE FROM sweep"], []),
        ("sweep", [SWEEP_2, "INSERT INTO sweep SELECT * FROM other.sweep WHERE log_sequence = 2"], [1, 2]),
        ("sweep", [SWEEP_2, "INSERT INTO sweep SELECT * FROM other.sweep WHERE log_sequence = 4"], [1, 4]),
        ("sweep", ["INSERT INTO sweep SELECT * FROM other.sweep WHERE log_sequence = 4"], [1, 2, 4]),
        ("set_aside", ["DELETE FROM set_aside"], [1, 2]),
        ("cursor", ["DELETE FROM cursor"], [1, 2]),
        ("cursor", ["UPDATE cursor SET (log_sequence, checksum) = (SELECT 4, checksum FROM other.cursor)"], [1, 2]),
    ],
)
def test_a_missing_row_and_a_sound_one_that_was_never_committed_are_found_by_the_chain(
    path: Path, tmp_path: Path, table: str, statements: list[str], left: list[int]
) -> None:
    other = tmp_path / "other.sqlite3"
    elsewhere, store = SweepStore(other, Window()), SweepStore(path, Window())
    elsewhere.commit([sweep(2, x_m=7.0), sweep(4)], [cursor(4)])
    elsewhere.close()
    store.commit([sweep(1), sweep(2), sweep(3)], [cursor(2)])
    store.commit([], [cursor(3)])
    store.set_aside((LOG, 3), "a bug")
    store.close()
    with closing(sqlite3.connect(path)) as database:
        database.execute("ATTACH ? AS other", (str(other),))
        with database:
            for statement in statements:
                database.execute(statement)
    reopened = SweepStore(path, Window())
    assert f"damaged (the rows of its table {table} are not those that were committed)" in reopened.damage
    assert (sequences(reopened), reopened.cursors()) == (left, {})  # all is read again from the logs
    reopened.close()
    assert SweepStore(path, Window()).damage == ""


def test_the_chain_holds_over_all_that_takes_sweeps_out_and_over_a_commit_that_fails(path: Path) -> None:
    store = SweepStore(path, Window(max_sweeps=20, sweeps_per_place=2))
    store.commit([sweep(number, x_m=number // 4) for number in range(1, 60)], [cursor(59)])
    store.set_aside((LOG, 58), "a bug")
    store.commit([sweep(59), sweep(60)], [cursor(60)], [Suspect(LOG, 50, 53, "the sensor is stuck")])
    store.commit([sweep(61, start_s=1e7)], [cursor(61)])  # all others are too old
    with pytest.raises(AttributeError):
        store.commit([sweep(62), None], [cursor(62)])  # pyright: ignore[reportArgumentType]
    assert sequences(store) == [61]
    store.close()
    with closing(sqlite3.connect(path)) as database:
        held = database.execute("SELECT of_table, held FROM chain ORDER BY of_table").fetchall()
    assert held == [("cursor", 1), ("set_aside", 1), ("sweep", 1)]
    assert SweepStore(path, Window()).damage == ""


def test_a_store_of_the_version_without_a_chain_keeps_all_it_has_and_is_chained_from_then_on(path: Path) -> None:
    store = SweepStore(path, Window())
    store.commit([sweep(1), sweep(2)], [cursor(2)])
    store.close()
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("DROP TABLE chain")
        database.execute("PRAGMA user_version = 4")
    reopened = SweepStore(path, Window())
    assert (reopened.damage, sequences(reopened), reopened.cursors()) == ("", [1, 2], {"u1": cursor(2)})
    reopened.close()
    with closing(sqlite3.connect(path)) as database, database:
        assert database.execute("PRAGMA user_version").fetchone() == (5,)
        database.execute(SWEEP_2)
    assert "its table sweep are not those that were committed" in SweepStore(path, Window()).damage
