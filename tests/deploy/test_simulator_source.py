"""Without Rust, `make demo` takes the wheel of the simulator, if it is of the present sources; without that too it says
what to type before any work.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from deploy.test_installed_packages import UV
from system.processes import ROOT

WHEEL = "noctule_sim-0.1.0-0{sources}-py3-none-linux_{machine}.whl"
TYPED = "    make demo RUST=fetch\n"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """What `make demo` reads before it does anything."""
    project = tmp_path / "project"
    shutil.copytree(
        ROOT / "firmware/simulator", project / "firmware/simulator", ignore=shutil.ignore_patterns("target")
    )
    (project / "deploy").mkdir()
    for path in (ROOT / "Makefile", *ROOT.glob("deploy/*.sh")):
        shutil.copy2(path, project / path.relative_to(ROOT))
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


def sources(project: Path) -> str:
    """Which sources of the simulator the project has."""
    return run(project, dict(os.environ), "sh", "deploy/simulator_sources.sh").stdout.strip()


def wheel_in(folder: Path, of: str) -> Path:
    """A wheel for this machine, of such sources."""
    folder.mkdir(exist_ok=True)
    wheel = folder / WHEEL.format(sources=of, machine=os.uname().machine)
    wheel.touch()
    return wheel


def install(project: Path, of: str) -> None:
    """An installed simulator, of such sources."""
    (project / ".venv/bin").mkdir(parents=True, exist_ok=True)
    (project / ".venv/bin/noctule-sim").touch()
    (project / ".venv/bin/noctule-sim").chmod(0o755)
    (project / ".venv/simulator-sources").write_text(f"{of}\n")


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

    def found() -> str:
        return source(project, without_rust, SIMULATOR_WHEELS=str(folder))

    wheel_in(folder, "0123456789ab")
    (folder / WHEEL.format(sources=sources(project), machine="other")).touch()
    assert TYPED in found()
    wheel = wheel_in(folder, sources(project))
    assert found() == str(wheel)
    cargo(without_rust, "echo cargo 1.88.0 today")
    assert found() == "build"
    for old in ("echo cargo 1.63.0", "exit 1"):  # Debian 12's, and a rustup without a toolchain
        cargo(without_rust, old)
        assert found() == str(wheel)
    wheel.unlink()
    assert "    curl https://sh.rustup.rs -sSf | sh -s -- -y    #" in found()  # without -y it asks, and stops
    (Path(without_rust["PATH"]) / "rustup").symlink_to("/bin/true")
    assert "    rustup update stable && rustup default stable\n" in found()


@pytest.mark.parametrize("changed", ["src/main.rs", "rooms/lounge.toml", "Cargo.lock", "src/new.rs"])
def test_no_wheel_and_no_installed_simulator_is_taken_once_the_sources_are_others(
    project: Path, without_rust: dict[str, str], changed: str
) -> None:
    install(project, sources(project))
    assert source(project, without_rust) == "installed"
    wheel = wheel_in(project / "wheels", sources(project))
    assert source(project, without_rust, SIMULATOR_WHEELS="wheels") == str(wheel.relative_to(project))
    with (project / "firmware/simulator" / changed).open("a") as file:
        file.write("\n")
    said = source(project, without_rust, SIMULATOR_WHEELS="wheels")
    assert "wheels has no wheel of its present sources" in said and TYPED in said


@pytest.mark.parametrize(
    ("goals", "needing"), [("test", "test"), ("docs lint", "lint"), ("soak", "soak"), ("docs", ""), ("bench", "")]
)
def test_what_runs_cargo_itself_takes_no_simulator_without_it(
    project: Path, without_rust: dict[str, str], goals: str, needing: str
) -> None:
    install(project, sources(project))
    (project / "deploy/packages.sh").write_text("sh deploy/simulator.sh; exit 1\n")  # and no package is installed
    ended = run(project, without_rust, "make", *goals.split())
    assert ended.returncode != 0
    if needing:
        assert (ended.stdout, f", and make {needing} runs cargo itself. Type:" in ended.stderr) == ("", True)
        assert f"    make {goals.split()[0]} RUST=fetch\n" in ended.stderr
    else:
        assert ended.stdout.splitlines()[0] == "installed"
    cargo(without_rust, "echo cargo 1.88.0 today")
    assert run(project, without_rust, "make", *goals.split()).stdout.splitlines()[0] == "build"


def synced(project: Path, environment: dict[str, str], *words: str) -> list[str]:
    """The words of the last command that is given to uv, with ``words`` for it."""
    uv = project / "uv"
    uv.write_text('#!/bin/sh\necho "$@"\n')
    uv.chmod(0o755)
    ended = run(project, environment, "sh", "deploy/sync.sh", "./uv", *words)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout.splitlines()[-1].split()


def test_a_simulator_that_is_not_built_is_not_removed_with_what_the_lock_file_does_not_name(
    project: Path, without_rust: dict[str, str]
) -> None:
    install(project, sources(project))
    for words in ((), ("--inexact",)):
        assert synced(project, without_rust, *words).count("--inexact") == 1  # uv refuses it twice
    cargo(without_rust, "echo cargo 1.88.0 today")
    assert "--inexact" not in synced(project, without_rust)


def test_the_set_up_says_what_it_fetches_unless_all_is_there(project: Path, without_rust: dict[str, str]) -> None:
    uv = project / "uv"
    uv.write_text("#!/bin/sh\n[ -e whole ] && exit\ncase $* in *--check*) exit 1 ;; esac\n")
    uv.chmod(0o755)
    environment = without_rust | {"SIZE": "387 MB"}
    install(project, sources(project))
    (project / ".venv/simulator-sources").unlink()  # the first set-up was cut off

    def said() -> str:
        ended = run(project, environment, "sh", "deploy/sync.sh", "./uv")
        assert ended.returncode == 0, ended.stderr
        return ended.stdout

    cargo(without_rust, "echo cargo 1.88.0 today")
    steps = [
        "Fetching Python packages (387 MB where none is here yet): up to two minutes",
        "Building the simulator: up to two minutes",
    ]
    assert said().splitlines() == steps
    assert said().splitlines() == steps  # those of the tests are missing, after those of the demo
    (project / "whole").touch()
    assert said() == ""


def test_a_step_that_fails_shows_the_end_of_its_log(project: Path) -> None:
    ended = run(project, dict(os.environ), "sh", "deploy/step.sh", "part", "Doing a part", "sh", "-c", "seq 30; exit 4")
    assert (ended.returncode, ended.stdout) == (4, "Doing a part\n")
    shown = [*map(str, range(11, 31)), "This failed: Doing a part. The lines above are the end of .tools/part.log."]
    assert ended.stderr.splitlines() == shown
    assert (project / ".tools/part.log").read_text().splitlines() == [str(number) for number in range(1, 31)]


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
    built = run(ROOT, dict(os.environ), "make", "wheel-simulator", f"SIMULATOR_WHEELS={wheels}")
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
    shutil.rmtree(wheels)
    exact = run(project, environment, "sh", "deploy/sync.sh", "uv", "--no-default-groups", "--group", "demo")
    assert exact.returncode == 0, exact.stderr
    assert run(project, environment, ".venv/bin/noctule-sim", "--version").returncode == 0
    assert run(project, environment, ".venv/bin/noctule-mapper", "--version").returncode == 0
    assert not (project / "firmware/simulator/target").exists()  # nothing was built
