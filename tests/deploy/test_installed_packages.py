"""install.sh with real packages: wheels of this tree, a virtual environment, pip; then wheels of the next version.

pip fetches nothing: it sees what the project's own environment has beside the project, in the versions of uv.lock.
"""

import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from deploy.test_install_script import Host
from system.processes import ROOT

UV = shutil.which("uv") or str(ROOT / ".tools/bin/uv")  # as the Makefile looks for it
PACKAGES = ("noctule", "noctule-mapper", "noctule-viewer")
OWN, NEXT = "0.1.0", "0.1.1"
ADDED = "sdk/src/noctule/added_by_the_next_version.py"


@pytest.fixture
def host(tmp_path: Path) -> Host:
    """The host of the other tests with the real Python."""
    made = Host(tmp_path)
    script = made.home / "server/install.sh"
    stub = f"python={tmp_path}/stubs/python3"
    assert stub in script.read_text()
    script.write_text(script.read_text().replace(stub, f"python={sys.base_prefix}/bin/python3"))
    return made


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """What stands in for the package index: all that the project's environment has, but for the project."""
    for path in Path(sysconfig.get_path("purelib")).iterdir():
        if "noctule" not in path.name:
            (tmp_path / "index").mkdir(exist_ok=True)
            (tmp_path / "index" / path.name).symlink_to(path)
    path = f"{tmp_path}/stubs:/usr/bin:/bin"
    return {"PATH": path, "PYTHONPATH": str(tmp_path / "index"), "PIP_NO_INDEX": "1", "HOME": str(tmp_path)}


def build(sources: Path, dist: Path) -> None:
    """What ``make wheels`` does, for the packages of this host."""
    shutil.rmtree(dist, ignore_errors=True)
    for package in PACKAGES:
        ran(UV, "build", "--quiet", "--wheel", "--package", package, "--out-dir", str(dist), cwd=sources)
    listed = ("export", "--quiet", "--frozen", "--no-dev", "--all-packages", "--no-emit-workspace", "--no-hashes")
    ran(UV, *listed, "--output-file", str(dist / "constraints.txt"), cwd=sources)


def of_the_next_version(folder: Path) -> Path:
    """The project's files with another version and one more module."""
    for name in ran("git", "ls-files", "--cached", "--others", "--exclude-standard", cwd=ROOT).splitlines():
        if name.endswith((".toml", ".lock", ".md")) or "/src/" in name:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    for path in folder.glob("*/pyproject.toml"):
        path.write_text(path.read_text().replace(f'\nversion = "{OWN}"', f'\nversion = "{NEXT}"'))
    (folder / ADDED).write_text("")
    return folder


def ran(*command: str, cwd: Path, env: dict[str, str] | None = None) -> str:
    """What the command prints; fails where the command does."""
    ended = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


@pytest.mark.soak
def test_the_packages_of_a_host_are_upgraded_in_place_and_their_commands_run(
    host: Host, environment: dict[str, str], tmp_path: Path
) -> None:
    bin_folder = host.root / "opt/noctule/bin"
    module = Path(ADDED).relative_to("sdk/src")

    def install() -> str:
        return ran("sh", "server/install.sh", "dist", cwd=host.home, env=environment)

    def versions() -> set[str]:
        commands = ("noctule-mapper", "noctule")
        return {ran(str(bin_folder / each), "--version", cwd=tmp_path, env=environment).split()[1] for each in commands}

    dist = host.home / "dist"
    build(ROOT, dist)
    shutil.copytree(dist, tmp_path / "own")
    assert "opt/noctule changes" in install()
    assert versions() == {OWN}
    assert "changes" not in install()

    build(of_the_next_version(tmp_path / "next"), dist)
    assert "opt/noctule changes" in install()
    assert versions() == {NEXT}
    assert list(bin_folder.parent.glob(f"lib/python3*/site-packages/{module}"))
    # One version of each package is left, and pip finds nothing missing.
    assert len(list(bin_folder.parent.glob("lib/python3*/site-packages/noctule*.dist-info"))) == len(PACKAGES)
    ran(str(bin_folder / "pip"), "check", cwd=tmp_path, env=environment)

    # Back again: the module of the version that was left is gone.
    shutil.rmtree(dist)
    (tmp_path / "own").rename(dist)
    install()
    assert versions() == {OWN}
    assert not list(bin_folder.parent.glob(f"lib/python3*/site-packages/{module}"))
