"""Data that programs of an earlier commit have written are taken over, each sweep as it was.

``earlier/`` holds what gateway and mapper of commit 8a18af2 (2026-11-28) had written when they ended: the log of a unit
with firmware 0.2.0 of that commit, carried once around the demo's paper room, and the store of the mapper that read it,
each as SQLite's own statements make it again.
"""

import sqlite3
from contextlib import closing
from pathlib import Path

from noctule.elapsed import Instant
from noctule.messages_pb2 import Sweep
from noctule_gateway.log.log_file import Retention
from noctule_gateway.log.sweep_log import SweepLog
from noctule_mapper.config import Window
from noctule_mapper.live.store import SweepStore

COUNT = 44  # stops of the paper's path
LOG_ID = "6a431cce71d7df88"
AFTERWARDS_S = 1_796_083_200.0  # 2026-12-01, UTC


def afterwards() -> Instant:
    return Instant(AFTERWARDS_S, "another boot", 0.0)


def unpacked(folder: Path, name: str, version: int) -> tuple[Path, list[bytes]]:
    """The file, and the sweeps in it as they were written."""
    path = folder / name
    statements = (Path(__file__).parent / "earlier" / f"{path.stem}.sql").read_text()
    table = {"u1.sqlite": "sweeps", "paper-room.sqlite3": "sweep"}[name]
    with closing(sqlite3.connect(path)) as database:
        database.executescript(statements)
        assert database.execute("PRAGMA user_version").fetchone() == (version,)
        records = database.execute(f"SELECT record FROM {table} ORDER BY log_sequence").fetchall()
    assert len(records) == COUNT
    return path, [record for (record,) in records]


def test_a_gateways_log_is_taken_over(tmp_path: Path) -> None:
    path, records = unpacked(tmp_path, "u1.sqlite", version=2)
    log = SweepLog(path, Retention(), afterwards)
    try:
        assert list(log.read(1, 2 * COUNT, 2**30).records) == records
        assert (log.state.log_id, log.state.head, log.state.tail) == (LOG_ID, COUNT, 1)
    finally:
        log.close()


def test_a_mappers_store_is_taken_over(tmp_path: Path) -> None:
    path, records = unpacked(tmp_path, "paper-room.sqlite3", version=2)
    store = SweepStore(path, Window(), afterwards)
    try:
        assert store.sweeps() == [Sweep.FromString(record) for record in records]
        assert [(each.log_id, each.log_sequence) for each in store.cursors().values()] == [(LOG_ID, COUNT)]
        assert store.damage == ""
    finally:
        store.close()
