"""What leaves a log by age: time that has passed, and no time that a wall clock shows."""

import resource
import secrets
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from gateway.test_sweep_log import append, arrival, opened, read
from sdk.host_clocks import DAY_S, NOON_S, Host

from noctule.elapsed import now
from noctule.messages_pb2 import Sweep
from noctule_gateway.log.log_file import Committed, Retention
from noctule_gateway.log.sweep_log import SweepLog

THIRTY_DAYS = Retention(max_age_s=30 * DAY_S)

# The tables as the first released gateway made them, under user_version 1.
SCHEMA_1 = """
CREATE TABLE log (log_id TEXT NOT NULL, head INTEGER NOT NULL, size_bytes INTEGER NOT NULL);
CREATE TABLE sweeps (
    log_sequence INTEGER PRIMARY KEY,
    boot INTEGER NOT NULL,
    sequence INTEGER NOT NULL,
    digest BLOB NOT NULL,
    start_tick INTEGER NOT NULL,
    committed_s REAL NOT NULL,
    record BLOB NOT NULL,
    UNIQUE (boot, sequence, digest)
);
"""


def sequences(log: SweepLog) -> list[int]:
    return [sweep.sequence for sweep in read(log)]


def test_a_wall_clock_that_is_set_by_forty_days_either_way_removes_nothing(tmp_path: Path) -> None:
    host = Host()
    with opened(tmp_path / "u1.sqlite", THIRTY_DAYS, host) as log:
        for sequence, set_s in enumerate((-40 * DAY_S, 40 * DAY_S, 40 * DAY_S, -40 * DAY_S)):
            append(log, arrival(2 * sequence))
            host.utc_s += set_s
            host.pass_time(15.0)
            append(log, arrival(2 * sequence + 1))
        assert sequences(log) == list(range(8))
        assert log.state.removed == 0


def test_sweeps_leave_when_they_are_older_by_the_time_that_has_passed(tmp_path: Path) -> None:
    host = Host()
    with opened(tmp_path / "u1.sqlite", THIRTY_DAYS, host) as log:
        append(log, arrival(1))
        host.pass_time(20 * DAY_S)
        host.utc_s -= 40 * DAY_S
        append(log, arrival(2))
        host.pass_time(11 * DAY_S)
        append(log, arrival(3))
        assert sequences(log) == [2, 3]
        assert log.state.removed == 1


def test_age_goes_on_over_restarts_of_the_gateway_also_while_it_is_down(tmp_path: Path) -> None:
    path, host = tmp_path / "u1.sqlite", Host()
    with opened(path, THIRTY_DAYS, host) as log:
        append(log, arrival(1))
    host.pass_time(20 * DAY_S)
    with opened(path, THIRTY_DAYS, host) as log:
        append(log, arrival(2))
        assert sequences(log) == [1, 2]
    host.pass_time(11 * DAY_S)
    with opened(path, THIRTY_DAYS, host) as log:
        assert sequences(log) == [2]


def test_the_time_that_the_machine_was_off_ages_nothing_and_the_time_before_it_counts(tmp_path: Path) -> None:
    path, host = tmp_path / "u1.sqlite", Host()
    with opened(path, THIRTY_DAYS, host) as log:
        append(log, arrival(1))
        host.pass_time(20 * DAY_S)
        append(log, arrival(2))
    host.boot(off_s=400 * DAY_S)
    with opened(path, THIRTY_DAYS, host) as log:
        append(log, arrival(3))
        assert sequences(log) == [1, 2, 3]
        host.pass_time(11 * DAY_S)
        append(log, arrival(4))
        assert sequences(log) == [2, 3, 4]


def write_schema_1(path: Path, sweeps: Sequence[Sweep], committed_s: float) -> str:
    """A file as the first gateway left it, 100 sweeps removed before; its log_id."""
    log_id = secrets.token_hex(8)
    with closing(sqlite3.connect(path)) as db:
        db.execute("PRAGMA journal_mode = WAL")
        db.executescript(SCHEMA_1)
        size_bytes = 0
        for log_sequence, sweep in enumerate(sweeps, start=101):
            sweep.log_id, sweep.log_sequence = log_id, log_sequence
            record = sweep.SerializeToString()
            size_bytes += len(record)
            digest = sweep.sequence.to_bytes(4, "little")
            row = (log_sequence, sweep.boot, sweep.sequence, digest, 0, committed_s, record)
            db.execute("INSERT INTO sweeps VALUES (?, ?, ?, ?, ?, ?, ?)", row)
        db.execute("INSERT INTO log VALUES (?, ?, ?)", (log_id, 100 + len(sweeps), size_bytes))
        db.execute("PRAGMA user_version = 1")
        db.commit()
    return log_id


def test_a_log_of_the_first_gateway_keeps_its_identity_and_every_record_and_ages_from_now(tmp_path: Path) -> None:
    path, host = tmp_path / "u1.sqlite", Host()
    old = [arrival(sequence).sweep for sequence in range(50)]
    log_id = write_schema_1(path, old, committed_s=NOON_S - 29 * DAY_S)
    with opened(path, THIRTY_DAYS, host) as log:
        assert (log.state.log_id, log.state.tail, log.state.head, log.state.removed) == (log_id, 101, 150, 100)
        assert log.state.size_bytes == sum(len(sweep.SerializeToString()) for sweep in old)
        host.pass_time(2 * DAY_S)
        again, new = append(log, arrival(7), arrival(50))
        assert isinstance(again, Committed) and isinstance(new, Committed)
        assert (again.fresh, again.log_sequence, new.log_sequence) == (False, 108, 151)
        assert read(log)[:50] == old
    with opened(path, THIRTY_DAYS, host) as log:
        host.pass_time(29 * DAY_S)
        append(log, arrival(51))
        assert [sweep.log_sequence for sweep in read(log)] == [151, 152]


def test_a_migration_that_a_full_disk_stops_is_done_when_there_is_room(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    log_id = write_schema_1(path, [arrival(1).sweep], committed_s=NOON_S)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))  # a -wal of one page is longer
    try:
        log = SweepLog(path, THIRTY_DAYS, Host())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "can't be opened" in log.state.error
    append(log, arrival(2))
    assert (log.state.log_id, log.state.error) == (log_id, "")
    assert sequences(log) == [1, 2]
    log.close()


def test_the_hosts_own_clocks_advance_and_name_the_boot() -> None:
    first, second = now(), now()
    assert len(first.kernel_boot) == 36  # a UUID: proc(5), /proc/sys/kernel/random/boot_id
    assert second.kernel_boot == first.kernel_boot
    assert second.since_boot_s > first.since_boot_s
