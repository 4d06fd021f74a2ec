"""``noctule-gateway repair``: logs as a killed gateway leaves them, set aside with every acknowledged sweep."""

import hashlib
import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from deploy.other_versions import make_log_earlier
from gateway.test_sweep_log import WRITER, append, arrival, opened, read

from noctule import elapsed
from noctule.folder_lock import FolderError, FolderLock, Owner, owner_of
from noctule_gateway.errors import LogError
from noctule_gateway.log.look import look_at_all
from noctule_gateway.log.repair import repair

ATTIC = Owner("gateway", "attic", "gateway")


def killed_while_writing(path: Path, acknowledged: int = 66) -> int:
    """A log whose writer was killed: its newest sweeps are in the -wal alone. How many were acknowledged."""
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)],
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])},
    )
    assert writer.stdout is not None
    told = [writer.stdout.readline() for _ in range(acknowledged)]
    writer.kill()
    told += writer.stdout.read().splitlines()
    writer.wait()
    assert Path(f"{path}-wal").stat().st_size > 0
    return len(told)


def spoil(path: Path) -> None:
    """Damage pages of old records as a bad card would: the file opens, and some of it can't be read."""
    with path.open("r+b") as file:
        file.seek(10 * 4096)
        file.write(b"\xff" * 3 * 4096)


def held(path: Path) -> list[int]:
    with opened(path) as log:
        return [sweep.log_sequence for sweep in read(log)]


def hashes(folder: Path) -> dict[str, str]:
    return {each.name: hashlib.sha256(each.read_bytes()).hexdigest() for each in folder.iterdir() if each.is_file()}


def test_a_sound_log_of_a_killed_gateway_is_set_aside_with_all_that_was_acknowledged(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    acknowledged = killed_while_writing(path)
    (done,) = repair(tmp_path, ["u1"])
    aside = tmp_path / "set-aside" / "u1.1"
    assert done.set_aside == aside
    assert done.sweeps >= acknowledged
    assert not list(tmp_path.glob("u1.*"))
    assert sorted(each.name for each in aside.iterdir()) == ["u1.sqlite", "u1.sqlite-head"]  # the -wal is in it
    assert held(aside / "u1.sqlite") == list(range(1, done.sweeps + 1))


def test_a_damaged_log_is_set_aside_byte_by_byte_and_an_earlier_one_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    for number in (1, 2):
        with opened(path) as log:
            append(log, *(arrival(sequence, boot=2) for sequence in range(1000)))
        killed_while_writing(path)
        spoil(path)
        before = hashes(tmp_path)
        (done,) = repair(tmp_path, [])
        assert "damaged" in done.trouble
        aside = tmp_path / "set-aside" / f"u1.{number}"
        assert done.set_aside == aside
        kept = hashes(aside)
        assert {name: kept[name] for name in ("u1.sqlite", "u1.sqlite-wal")} == {
            name: before[name] for name in ("u1.sqlite", "u1.sqlite-wal")
        }
        assert not list(tmp_path.glob("u1.*"))
    assert len(list((tmp_path / "set-aside").iterdir())) == 2


def test_without_a_unit_only_damaged_logs_are_set_aside_and_the_sound_ones_stay_as_they_are(tmp_path: Path) -> None:
    acknowledged = killed_while_writing(tmp_path / "u1.sqlite")
    (tmp_path / "u2.sqlite").write_bytes(b"no database at all " * 100)
    before = hashes(tmp_path)
    sound, damaged = repair(tmp_path, [])
    assert (sound.unit, sound.trouble, sound.set_aside) == ("u1", "", None)
    assert sound.sweeps >= acknowledged
    assert (damaged.unit, damaged.sweeps) == ("u2", 0)
    assert damaged.set_aside == tmp_path / "set-aside" / "u2.1"
    for name in ("u1.sqlite", "u1.sqlite-wal"):
        assert hashes(tmp_path)[name] == before[name]


def test_a_record_that_is_no_sweep_and_an_empty_table_are_damage(tmp_path: Path) -> None:
    for unit, statement in (
        ("u1", "UPDATE sweeps SET record = x'ffffffff' WHERE log_sequence = 2"),
        ("u2", "DELETE FROM log"),
        ("u3", "DROP TABLE sweeps"),
    ):
        with opened(tmp_path / f"{unit}.sqlite") as log:
            append(log, *map(arrival, range(5)))
        with closing(sqlite3.connect(tmp_path / f"{unit}.sqlite")) as db, db:
            db.execute(statement)
    found = repair(tmp_path, [])
    assert [(each.sweeps, each.set_aside is not None) for each in found] == [(4, True), (5, True), (0, True)]
    assert "1 more records can't be read" in str(found[0])


def test_a_log_whose_table_is_empty_is_rebuilt_by_the_gateway_under_the_same_id(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    with opened(path) as log:
        append(log, arrival(1))
        log_id = log.state.log_id
    with closing(sqlite3.connect(path)) as db, db:
        db.execute("DELETE FROM log")
    with opened(path) as log:
        assert (log.state.log_id, log.state.head, log.state.error) == (log_id, 1, "")
        assert "none of its sweeps is lost: its table log does not fit" in log.state.damage
        assert [sweep.sequence for sweep in read(log)] == [1]


def test_a_wal_whose_database_is_gone_is_set_aside_before_a_new_log_would_delete_it(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    killed_while_writing(path)
    path.rename(tmp_path / "elsewhere")
    (done,) = repair(tmp_path, ["u1"])
    assert done.set_aside is not None
    assert (done.set_aside / "u1.sqlite-wal").stat().st_size > 0


def test_repair_refuses_while_a_gateway_holds_the_folder_and_keeps_whose_it_is(tmp_path: Path) -> None:
    with opened(tmp_path / "u1.sqlite") as log, FolderLock(tmp_path, ATTIC):
        append(log, arrival(1))
        with pytest.raises(FolderError, match=r"in use by gateway 'gateway' of site 'attic' \(process \d+\)"):
            repair(tmp_path, ["u1"])
    repair(tmp_path, ["u1"])
    with pytest.raises(FolderError, match="site 'attic'"):
        FolderLock(tmp_path, Owner("gateway", "cellar", "gateway"))
    FolderLock(tmp_path, ATTIC).close()


def test_a_folder_that_was_never_locked_belongs_to_nobody_after_a_repair(tmp_path: Path) -> None:
    killed_while_writing(tmp_path / "u1.sqlite")
    repair(tmp_path, [])
    FolderLock(tmp_path, ATTIC).close()
    assert owner_of(tmp_path) == ATTIC


def test_what_can_not_be_repaired_is_named(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="is no gateway's data folder"):
        repair(tmp_path / "none", [])
    assert not (tmp_path / "none").exists()
    FolderLock(tmp_path / "mapper", Owner("mapper", "attic", "mapper")).close()
    with pytest.raises(LogError, match="is no gateway's data folder"):
        repair(tmp_path / "mapper", [])
    with opened(tmp_path / "u1.sqlite"):
        pass
    with pytest.raises(LogError, match="holds no log of unit 'u7': it holds u1"):
        repair(tmp_path, ["u7"])
    with closing(sqlite3.connect(tmp_path / "u1.sqlite")) as db:
        db.execute("PRAGMA user_version = 99")
    with pytest.raises(LogError, match="schema 99"):
        repair(tmp_path, [])


def test_the_command_says_what_it_did(tmp_path: Path) -> None:
    acknowledged = killed_while_writing(tmp_path / "u1.sqlite")
    command = ["noctule-gateway", "repair", str(tmp_path)]
    looked = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert looked.endswith("readable sweeps; the file is sound; left as it is\n")
    done = subprocess.run([*command, "--unit", "u1"], capture_output=True, text=True, check=True).stdout
    assert done.endswith(f"set aside in {tmp_path}/set-aside/u1.1: the gateway begins a new log\n")
    assert int(done.split()[1]) >= acknowledged
    refused = subprocess.run([*command, "--unit", "u1"], capture_output=True, text=True, check=False)
    assert (refused.returncode, "holds no log of unit 'u1'" in refused.stderr) == (1, True)
    wrong = tmp_path / "wrong"
    wrong.mkdir()
    refused = subprocess.run([*command[:2], str(wrong)], capture_output=True, text=True, check=False)
    assert (refused.returncode, refused.stdout, list(wrong.iterdir())) == (1, "", [])
    assert "wrong holds no logs: give what noctule-gateway run has as --data" in refused.stderr


def test_check_reads_a_log_under_a_running_gateway_and_names_what_is_damaged(tmp_path: Path) -> None:
    with opened(tmp_path / "u1.sqlite") as log, opened(tmp_path / "u2.sqlite") as other:
        append(log, *map(arrival, range(5)))
        append(other, arrival(1, unit="u2"))
        with closing(sqlite3.connect(tmp_path / "u1.sqlite")) as db, db:
            db.execute("UPDATE sweeps SET boot = 3 WHERE log_sequence = 2")
        command = ["noctule-gateway", "check", str(tmp_path)]
        looked = subprocess.run(command, capture_output=True, text=True, check=False)
    damaged, sound = looked.stdout.splitlines()
    assert damaged.startswith("u1: 4 sound sweeps, sequences 1 to 5; the file is damaged: ")
    assert "sweep 2: its checksum does not fit" in damaged
    assert sound == "u2: 1 sound sweeps, sequences 1 to 1; all is sound"
    assert looked.returncode == 1


def test_check_changes_no_file_and_says_that_all_is_sound_after_a_kill(tmp_path: Path) -> None:
    acknowledged = killed_while_writing(tmp_path / "u1.sqlite")
    before = hashes(tmp_path)
    (found,) = look_at_all(tmp_path)
    assert (found.trouble, found.sweeps >= acknowledged) == ("", True)
    after = hashes(tmp_path)
    assert [name for name in before if after[name] != before[name] and not name.endswith("-shm")] == []
    with pytest.raises(LogError, match="holds no logs"):
        look_at_all(tmp_path / "none")
    site_file = tmp_path / "attic.toml"
    site_file.touch()
    with pytest.raises(LogError, match="for a site file type noctule doctor"):
        look_at_all(site_file)


def test_check_says_that_a_log_without_its_newest_commits_is_not_sound_and_repair_leaves_it_to_the_gateway(
    tmp_path: Path,
) -> None:
    """SQLite reads a -wal up to the first damaged frame, and says nothing of the others."""
    acknowledged = killed_while_writing(tmp_path / "u1.sqlite")
    wal = tmp_path / "u1.sqlite-wal"
    whole = bytearray(wal.read_bytes())
    whole[len(whole) // 2] ^= 4
    wal.write_bytes(whole)
    (found,) = look_at_all(tmp_path)
    assert 0 < found.head < acknowledged <= found.committed
    assert not found.is_sound
    assert str(found).endswith(f"; its newest commits, up to sweep {found.committed}, are gone")
    assert [each.set_aside for each in repair(tmp_path, [])] == [None]
    with opened(tmp_path / "u1.sqlite", now=elapsed.now):  # as the gateway does, which states what is lost
        pass
    (after,) = look_at_all(tmp_path)
    assert (after.is_sound, after.sweeps, after.stated) == (True, found.sweeps, found.committed - found.head)


@pytest.mark.parametrize("before_an_upgrade", [False, True])
def test_a_backup_of_a_running_gateway_holds_what_was_committed_and_restores_under_a_new_id(
    tmp_path: Path, before_an_upgrade: bool
) -> None:
    data, out = tmp_path / "data", tmp_path / "out"
    data.mkdir()
    with opened(data / "u1.sqlite") as log:
        append(log, *map(arrival, range(20)))
        command = ["noctule-gateway", "backup", str(data), str(out)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        again = subprocess.run(command, capture_output=True, text=True, check=False)
        if before_an_upgrade:
            make_log_earlier(out / "u1.sqlite", head_file=True)
        append(log, arrival(20))  # after the backup: sequence 21 stands for this sweep, and for no other
        log_id = log.state.log_id
    assert done.stdout == "u1: 20 sound sweeps, sequences 1 to 20; all is sound\n"
    assert (again.returncode, "is there already" in again.stderr) == (1, True)
    with opened(out / "u1.sqlite") as log:
        assert [sweep.sequence for sweep in read(log)] == list(range(20))
        assert log.state.log_id != log_id
