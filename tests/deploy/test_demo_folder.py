"""The demo's data folder: what the demo did not make is never deleted, wherever DEMO_DATA points to."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from folder import MARKER, FolderError, begin
from rooms import USUAL, site_file
from system.processes import PATIENCE_S, ROOT, free_ports

SITE_FILE = site_file(USUAL, unit_port=7101)
OWN = {MARKER, "site.toml"}


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below the folder."""
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def real_site(folder: Path) -> Path:
    """A folder as a user has it: a site of their own and what was measured there."""
    (folder / "gateway").mkdir(parents=True)
    (folder / "site.toml").write_text('site = "attic"\n')
    (folder / "gateway/u7.sqlite").write_bytes(b"a year of sweeps")
    return folder


def made_by_the_demo(folder: Path) -> Path:
    """A folder as the demo leaves it."""
    begin(folder, SITE_FILE).close()
    for part in ("gateway", "mapper"):
        (folder / part).mkdir()
        (folder / part / "log.sqlite").write_bytes(b"simulated sweeps")
    return folder


def refused(folder: Path, held_in: Path) -> str:
    """Why the demo does not begin in ``folder``; everything in ``held_in`` stays byte for byte as it is."""
    before = contents(held_in)
    with pytest.raises(FolderError) as refusal:
        begin(folder, SITE_FILE)
    assert contents(held_in) == before
    return str(refusal.value)


def test_the_demo_as_a_command_refuses_the_folder_of_a_real_site_and_leaves_it_as_it_is(tmp_path: Path) -> None:
    folder = real_site(tmp_path / "attic")
    before = contents(folder)
    names = ("UNIT", "ZENOH", "RERUN", "WEB")
    ports = {f"DEMO_{name}_PORT": str(port) for name, port in zip(names, free_ports(len(names)), strict=True)}
    command = [sys.executable, "deploy/demo/run.py"]
    environment = os.environ | ports | {"DEMO_DATA": str(folder)}
    ended = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=PATIENCE_S)
    assert ended.returncode == 1
    assert ended.stderr == (
        f"{folder} holds what the demo did not make (gateway, site.toml); nothing was changed: "
        "choose another folder with DEMO_DATA=...\n"
    )
    assert contents(folder) == before


def test_a_new_and_an_empty_folder_are_the_demos(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "new/below"):
        with begin(folder, site_file(USUAL, 7102)):
            assert "socket://127.0.0.1:7102" in (folder / "site.toml").read_text()
            assert "deletes" in (folder / MARKER).read_text()
        shutil.rmtree(folder)


def test_the_next_demo_begins_without_what_the_last_one_made(tmp_path: Path) -> None:
    folder = made_by_the_demo(tmp_path / "data")
    with begin(folder, SITE_FILE):
        assert contents(folder).keys() == OWN


def test_without_the_marker_all_is_the_users_even_the_demos_own_site_file(tmp_path: Path) -> None:
    folder = made_by_the_demo(tmp_path / "data")
    (folder / MARKER).unlink()
    assert "gateway, mapper, site.toml" in refused(folder, folder)


def test_a_users_file_in_the_demos_folder_is_named_and_kept(tmp_path: Path) -> None:
    folder = made_by_the_demo(tmp_path / "data")
    (folder / "notes.txt").write_text("what I saw")
    assert "(notes.txt)" in refused(folder, folder)


def test_a_long_list_of_files_is_cut(tmp_path: Path) -> None:
    for number in range(60):
        (tmp_path / f"{number:02}.txt").touch()
    assert "(00.txt, 01.txt, 02.txt and 57 more)" in refused(tmp_path, tmp_path)


def test_a_file_or_a_dangling_link_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("text")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    for path in (tmp_path / "file", tmp_path / "link"):
        assert "is not a folder" in refused(path, tmp_path)


def test_a_link_is_what_it_leads_to(tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(real_site(tmp_path / "attic"))
    refused(link, tmp_path / "attic")
    link.unlink()
    link.symlink_to(made_by_the_demo(tmp_path / "data"))
    with begin(link, SITE_FILE):
        assert contents(tmp_path / "data").keys() == OWN


def test_of_a_link_in_the_demos_folder_only_the_link_is_deleted(tmp_path: Path) -> None:
    folder, attic = made_by_the_demo(tmp_path / "data"), real_site(tmp_path / "attic")
    before = contents(attic)
    shutil.rmtree(folder / "gateway")
    (folder / "gateway").symlink_to(attic / "gateway")
    (folder / "site.toml").unlink()
    (folder / "site.toml").symlink_to(attic / "site.toml")
    with begin(folder, SITE_FILE):
        assert contents(folder).keys() == OWN
    assert contents(attic) == before


def test_the_root_the_home_and_the_current_folder_are_refused(tmp_path: Path, monkeypatch) -> None:
    home = real_site(tmp_path / "home")
    monkeypatch.chdir(home)
    refused(Path(), home)
    refused(home, home)
    with pytest.raises(FolderError):
        begin(Path("/"), SITE_FILE)
    assert not Path("/", MARKER).exists()


def test_two_demos_can_not_begin_in_one_folder(tmp_path: Path) -> None:
    folder = made_by_the_demo(tmp_path / "data")
    with begin(folder, SITE_FILE):
        assert "another demo runs in" in refused(folder, folder)
