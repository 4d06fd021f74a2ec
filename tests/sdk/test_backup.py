"""A backup that fails leaves nothing behind, so that it can be begun again; a folder that was there before stays."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from noctule.backup import BackupError, copy_databases, whole_or_nothing


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data folder with a sound database and one that is none."""
    data = tmp_path / "data"
    data.mkdir()
    with closing(sqlite3.connect(data / "u1.sqlite")) as database, database:
        database.execute("CREATE TABLE some (thing)")
    (data / "u2.sqlite").write_bytes(b"no database" * 1000)
    return data


def copy(data: Path, out: Path) -> None:
    with whole_or_nothing(out):
        copy_databases(data, out, lambda *_: None)


def test_a_backup_that_fails_leaves_nothing_and_can_be_begun_again(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(BackupError, match=r"u2\.sqlite can't be copied"):
        copy(data, out)
    assert not out.exists()
    (data / "u2.sqlite").unlink()
    copy(data, out)
    assert [path.name for path in out.iterdir()] == ["u1.sqlite"]


def test_a_folder_that_was_there_before_is_left_as_it_is(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "u1.sqlite").write_text("the backup of yesterday")
    with pytest.raises(BackupError, match="is there already"):
        copy(data, out)
    assert (out / "u1.sqlite").read_text() == "the backup of yesterday"


def test_a_folder_within_the_data_is_refused_and_not_made(data: Path) -> None:
    with pytest.raises(BackupError, match="give a folder outside"):
        copy(data, data / "copy")
    assert not (data / "copy").exists()
