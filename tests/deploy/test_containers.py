"""The image and the compose files fit each other, and are what their formats allow.

test_container_image.py builds the image.
"""

import json
import re
import shlex
import subprocess
import tomllib
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath

import pytest
import yaml
from system.processes import ROOT
from typer.testing import CliRunner

from noctule_deploy import cli, fleet_file, render
from noctule_deploy.render import Place

FILE = ROOT / "deploy/container/Containerfile"
OWN = "noctule"  # the tag that the README gives to the image
STEPS = re.findall(r"^([A-Z]+) ((?:.*\\\n)*.*)$", FILE.read_text(), re.MULTILINE)
TOP = ("/etc/noctule", "/var/lib/noctule")


@pytest.fixture(scope="module")
def compose_files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Of all hosts of the example, with a router on a host of its own."""
    folder = tmp_path_factory.mktemp("containers")
    assert CliRunner().invoke(cli.app, ["init", str(folder)]).exit_code == 0
    fleet = folder / "fleet.toml"
    fleet.write_text(fleet.read_text() + '[[router]]\nname = "router-2"\naddress = "hub.example.net"\nhost = "hub"\n')
    place = Place(folder / "rendered", folder / "ca")
    render.render(fleet_file.load(fleet), place, datetime(2026, 3, 1, tzinfo=UTC))
    return sorted(place.out.glob("*/compose.yaml"))


@pytest.fixture(scope="module")
def services(compose_files: list[Path]) -> dict[str, dict]:
    """The services of all hosts."""
    return {name: each for file in compose_files for name, each in yaml.safe_load(file.read_text())["services"].items()}


def words(step: str) -> list[str]:
    """All words of the steps of a kind."""
    return [word for name, text in STEPS if name == step for word in shlex.split(text.replace("\\\n", " "))]


def installed() -> set[str]:
    """The commands of the wheels that ``make wheels`` builds and the image installs."""
    (packages,) = re.findall(r"^WHEELS := (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    projects = [tomllib.loads(path.read_text())["project"] for path in ROOT.glob("*/pyproject.toml")]
    return {command for each in projects if each["name"] in packages.split() for command in each["scripts"]}


def settings() -> dict[str, str]:
    return dict(word.split("=", 1) for word in words("ENV"))


def test_every_compose_file_is_one_by_the_schema_of_compose(compose_files: list[Path], tmp_path: Path) -> None:
    """The schema is the one that the Compose Specification publishes."""

    def checked(*files: Path) -> str:
        command = ["check-jsonschema", "--builtin-schema", "vendor.compose-spec", *map(str, files)]
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout

    assert len(compose_files) == 3
    assert checked(*compose_files) == "ok -- validation done\n"
    wrong = tmp_path / "compose.yaml"
    wrong.write_text(compose_files[0].read_text().replace('"read_only"', '"readonly"'))
    assert "'readonly' was unexpected" in checked(wrong)


def test_the_steps_of_the_image_have_no_fault_that_hadolint_knows() -> None:
    ended = subprocess.run(["hadolint", "--no-color", str(FILE)], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (0, "")


def test_the_image_is_made_of_what_make_wheels_puts_into_dist() -> None:
    *sources, target = words("COPY")
    assert sources == ["dist/*.whl", "dist/constraints.txt"]  # and no wheel of the simulator
    run = words("RUN")
    assert {f"{target}*.whl", f"{target}constraints.txt"} <= set(run)
    assert "--output-file dist/constraints.txt" in (ROOT / "Makefile").read_text()
    assert words("USER") == ["65534:65534"]  # nobody


def test_every_program_of_a_compose_file_is_in_the_image_where_its_command_says(services: dict[str, dict]) -> None:
    run = words("RUN")
    venv = PurePosixPath(run[run.index("venv") + 1])
    own = {name: each for name, each in services.items() if each["image"] == OWN}
    assert {name.split("-")[0] for name in own} == {"gateway", "mapper", "viewer"}
    for each in own.values():
        program = PurePosixPath(each["command"][0])
        assert program.parent == venv / "bin"
        assert program.name in installed()
    others = {name.split("-")[0]: each["image"] for name, each in services.items() if each["image"] != OWN}
    zenoh = next(
        each for each in tomllib.loads((ROOT / "uv.lock").read_text())["package"] if each["name"] == "eclipse-zenoh"
    )
    # A router of another version than the clients' is never tried.
    assert others == {"router": f"docker.io/eclipse/zenoh:{zenoh['version']}", "web": "docker.io/library/caddy:2"}


def test_every_path_of_a_command_is_in_a_volume_and_what_is_written_is_writable(services: dict[str, dict]) -> None:
    for each in services.values():
        assert each["read_only"] is True
        volumes = {mode.split(":")[1]: mode.split(":")[2:] for mode in each["volumes"]}
        assert volumes == {"/etc/noctule": ["ro"], "/var/lib/noctule": []}
        paths = [word for word in each["command"] if word.startswith("/") and not word.startswith(("/opt/", "/usr/"))]
        assert paths == [] or all(path.startswith(tuple(f"{top}/" for top in TOP)) for path in paths)
        if "--data" in each["command"]:
            assert each["command"][each["command"].index("--data") + 1].startswith("/var/lib/noctule/")
        assert each["tmpfs"] == ["/tmp"]
    # What the programs write beside their data goes into the temporary file system.
    assert settings()["NUMBA_CACHE_DIR"].startswith("/tmp/")


def test_what_a_killed_process_of_a_map_leaves_is_reaped(services: dict[str, dict]) -> None:
    assert {name.split("-")[0] for name, each in services.items() if each.get("init")} == {"mapper"}


def test_every_service_runs_as_the_owner_of_its_files(services: dict[str, dict]) -> None:
    users = {each["user"] for each in services.values()}
    assert len(users) == 1
    (user,) = users
    assert user.startswith("${NOCTULE_USER:?")  # compose refuses to start without it
    text = json.dumps(services)
    assert "privileged" not in text.replace("no-new-privileges", "")
