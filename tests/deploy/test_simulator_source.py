"""Without Rust, `make demo` takes the wheel of the simulator; without that too it says what to type before any work."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from deploy.test_installed_packages import UV
from system.processes import ROOT

WHEEL = "noctule_sim-0.1.0-py3-none-linux_{machine}.whl"
TYPED = "    make demo RUST=fetch\n"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """What `make demo` reads before it does anything."""
    project = tmp_path / "project"
    for name in ("Makefile", "deploy/packages.sh", "deploy/simulator.sh", "firmware/simulator/pyproject.toml"):
        (project / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, project / name)
    return project


@pytest.fixture
def without_rust(tmp_path: Path) -> dict[str, str]:
    """An environment whose commands are this machine's without those of Rust."""
    commands = tmp_path / "commands"
    commands.mkdir()
    for folder in ("/usr/bin", "/bin", "/usr/sbin"):
        for path in Path(folder).iterdir():
            if not path.name.startswith(("cargo", "rust")) and not (commands / path.name).exists():
                (commands / path.name).symlink_to(path)
    if not (commands / "uv").exists():
        (commands / "uv").symlink_to(UV)
    return {"PATH": str(commands), "HOME": str(tmp_path / "home")}


def run(project: Path, environment: dict[str, str], *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, check=False)


def cargo(environment: dict[str, str], script: str) -> None:
    """Make this the cargo of the environment."""
    path = Path(environment["PATH"]) / "cargo"
    path.unlink(missing_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


def source(project: Path, environment: dict[str, str], **settings: str) -> str:
    """Where the simulator comes from, or what is said where it comes from nowhere."""
    ended = run(project, environment | settings, "sh", "deploy/simulator.sh")
    assert bool(ended.returncode) == bool(ended.stderr)
    return ended.stdout.strip() or ended.stderr


def test_without_rust_and_wheel_the_line_to_type_comes_before_any_work(
    project: Path, without_rust: dict[str, str]
) -> None:
    before = sorted(project.rglob("*"))
    ended = run(project, without_rust, "make", "demo")
    assert ended.returncode != 0
    assert ended.stdout == ""
    assert ended.stderr.startswith("Nothing was done: ") and TYPED in ended.stderr
    assert sorted(project.rglob("*")) == before
    assert source(project, without_rust, RUST="fetch") == "build"


def test_rust_comes_before_a_wheel_and_a_wheel_before_an_old_rust(project: Path, without_rust: dict[str, str]) -> None:
    folder = project / "elsewhere"
    folder.mkdir()
    wheel = folder / WHEEL.format(machine=os.uname().machine)

    def found() -> str:
        return source(project, without_rust, SIMULATOR_WHEELS=str(folder))

    for other in (WHEEL.format(machine="other"), wheel.name.replace("0.1.0", "0.0.9")):
        (folder / other).touch()
    assert TYPED in found()
    wheel.touch()
    assert found() == str(wheel)
    cargo(without_rust, "echo cargo 1.88.0 today")
    assert found() == "build"
    for old in ("echo cargo 1.63.0", "exit 1"):  # Debian 12's, and a rustup without a toolchain
        cargo(without_rust, old)
        assert found() == str(wheel)
    wheel.unlink()
    assert "    rustup update stable\n" in found()


def test_a_simulator_that_is_installed_is_taken_in_the_projects_version_only(
    project: Path, without_rust: dict[str, str]
) -> None:
    installed = project / ".venv/bin/noctule-sim"
    installed.parent.mkdir(parents=True)
    for version, found in (("0.1.0", "installed"), ("0.0.9", "")):
        installed.write_text(f"#!/bin/sh\necho noctule-sim {version}\n")
        installed.chmod(0o755)
        said = source(project, without_rust)
        assert said == found if found else TYPED in said


@pytest.mark.soak
def test_the_set_up_of_the_demo_installs_the_wheel(tmp_path: Path, without_rust: dict[str, str]) -> None:
    """With all else from uv's cache, which holds what the project's own environment has."""
    project = tmp_path / "clone"
    listed = run(ROOT, dict(os.environ), "git", "ls-files", "--cached", "--others", "--exclude-standard")
    for name in listed.stdout.splitlines():
        if (ROOT / name).is_file():
            (project / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, project / name)
    wheels = tmp_path / "wheels"
    built = run(
        ROOT, dict(os.environ), UV, "build", "--quiet", "--wheel", "--package", "noctule-sim", "-o", str(wheels)
    )
    assert built.returncode == 0, built.stderr
    cache = run(ROOT, dict(os.environ), UV, "cache", "dir").stdout.strip()
    python = run(ROOT, dict(os.environ), "python", "-c", "import sys; print(sys.base_prefix)").stdout.strip()
    environment = without_rust | {
        "UV_CACHE_DIR": cache,
        "UV_OFFLINE": "1",
        "UV_PYTHON": f"{python}/bin/python3",
        "SIMULATOR_WHEELS": str(wheels),
    }
    for _ in range(2):
        ended = run(project, environment, "make", "setup-demo")
        assert ended.returncode == 0, ended.stdout + ended.stderr
        shown = run(project, environment, ".venv/bin/noctule-sim", "--version")
        assert shown.stdout == "noctule-sim 0.1.0\n"
    assert run(project, environment, ".venv/bin/noctule-mapper", "--version").returncode == 0
    assert not (project / "firmware/simulator/target").exists()  # nothing was built
