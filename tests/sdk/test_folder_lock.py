"""The lock on a data folder, held by real processes that are killed."""

import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from noctule.folder_lock import FILE_NAME, FolderError, FolderLock, Owner, owner_of

ATTIC = Owner("gateway", "attic", "north")
HOLDER = """
import sys
from pathlib import Path
from noctule.folder_lock import FolderLock, Owner
lock = FolderLock(Path(sys.argv[1]), Owner("gateway", "attic", "north"))
print("held", flush=True)
sys.stdin.read()
"""


@contextmanager
def holder(folder: Path) -> Iterator["subprocess.Popen[str]"]:
    """Another process that holds ``folder``, until it is killed."""
    command = [sys.executable, "-c", HOLDER, str(folder)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_a_folder_that_another_process_holds_is_refused_with_its_name_and_process(tmp_path: Path) -> None:
    with holder(tmp_path) as other:
        with pytest.raises(FolderError) as refused:
            FolderLock(tmp_path, ATTIC)
        assert str(refused.value) == (
            f"{tmp_path} is in use by gateway 'north' of site 'attic' (process {other.pid}): "
            "stop that, or give this gateway a folder of its own"
        )


def test_the_same_process_can_not_hold_a_folder_twice(tmp_path: Path) -> None:
    with FolderLock(tmp_path, ATTIC), pytest.raises(FolderError, match=f"process {os.getpid()}"):
        FolderLock(tmp_path, ATTIC)
    FolderLock(tmp_path, ATTIC).close()


def test_a_killed_holder_leaves_the_folder_free_for_the_next_one(tmp_path: Path) -> None:
    with holder(tmp_path) as first:
        first.kill()
        first.wait()
        with holder(tmp_path) as second, pytest.raises(FolderError, match=f"process {second.pid}"):
            FolderLock(tmp_path, ATTIC)


def test_a_child_of_the_holder_does_not_hold_the_folder(tmp_path: Path) -> None:
    with FolderLock(tmp_path, ATTIC):
        child = subprocess.Popen([sys.executable, "-c", "import sys; sys.stdin.read()"], stdin=subprocess.PIPE)
    try:
        FolderLock(tmp_path, ATTIC).close()
    finally:
        child.communicate()


@pytest.mark.parametrize("other", [Owner("mapper", "attic", "north"), Owner("gateway", "cellar", "north")])
def test_a_folder_of_another_role_or_site_is_refused_though_nobody_holds_it(tmp_path: Path, other: Owner) -> None:
    FolderLock(tmp_path, ATTIC).close()
    with pytest.raises(FolderError, match=r"holds the data of a gateway of site 'attic': .* a folder of its own"):
        FolderLock(tmp_path, other)
    assert owner_of(tmp_path) == ATTIC
    FolderLock(tmp_path, Owner("gateway", "attic", "south")).close()  # under another name it is the same data


@pytest.mark.parametrize(
    "left", [b"", b"\x00" * 512, b'{"role": "gateway"', b"[]", b"7", b"\xff\xfe" * 9000, b"[" * 4096]
)
def test_whatever_a_power_cut_left_in_the_file_does_not_keep_the_folder_from_its_owner(
    tmp_path: Path, left: bytes
) -> None:
    (tmp_path / FILE_NAME).write_bytes(left)
    with FolderLock(tmp_path, ATTIC), pytest.raises(FolderError, match="gateway 'north' of site 'attic'"):
        FolderLock(tmp_path, ATTIC)
    assert owner_of(tmp_path) == ATTIC


def test_a_lock_whose_file_was_deleted_is_taken_again_or_says_that_another_has_it(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    with FolderLock(folder, ATTIC) as lock:
        (folder / FILE_NAME).unlink()
        folder.rmdir()
        lock.keep()
        assert not folder.exists()
        folder.mkdir()
        lock.keep()
        with pytest.raises(FolderError, match="in use"):
            FolderLock(folder, ATTIC)
        (folder / FILE_NAME).unlink()
        with holder(folder) as other, pytest.raises(FolderError, match=f"process {other.pid}"):
            lock.keep()


def test_what_is_no_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for path in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(FolderError, match=f"{path} is no folder"):
            FolderLock(path, ATTIC)


def test_a_folder_that_can_not_be_written_is_named() -> None:
    with pytest.raises(FolderError, match=r"/proc/self can't be used .* be written to"):
        FolderLock(Path("/proc/self"), ATTIC)  # nobody can make a file there, root neither


def test_a_full_disk_refuses_a_new_folder_and_does_not_hinder_one_that_was_held_before(tmp_path: Path) -> None:
    held_before, new = tmp_path / "old", tmp_path / "new"
    FolderLock(held_before, ATTIC).close()
    size = (held_before / FILE_NAME).stat().st_size
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))  # the file may be written again and not grow
    try:
        FolderLock(held_before, ATTIC).close()
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
        with pytest.raises(FolderError, match=f"{new} can't be used .* disk has room"):
            FolderLock(new, ATTIC)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
