"""buildah builds the image from its own file and from wheels of this tree, and the programs run in it as compose says.

Without daemon, registry and package index: the base is this machine's Python in place of the one that the file names,
and pip finds installed what the project's environment has beside the project.
"""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import pytest
from deploy.test_containers import FILE, words
from deploy.test_installed_packages import UV
from system.processes import PATIENCE_S, ROOT, wait_until
from typer.testing import CliRunner

from noctule_deploy import cli, fleet_file, render
from noctule_deploy.render import Place

pytestmark = [
    pytest.mark.soak,
    pytest.mark.skipif(os.getuid() != 0, reason="needs root"),
]
BASE = FILE.read_text().split("FROM ")[1].split()[0]
NOBODY = "65534"
OWNER = 12345  # of the rendered files; no user of the image
PATH = f"{sys.base_prefix}/bin:/usr/bin:/bin"


@dataclass
class Images:
    """buildah with a store of its own, which the test's folder holds."""

    folder: Path
    index: Path

    def buildah(self, *words: str, command: str) -> list[str]:
        """The words of a buildah command."""
        store = ["--root", f"{self.folder}/root", "--runroot", f"{self.folder}/run", "--storage-driver", "vfs"]
        return ["buildah", *store, command, *words]

    def ran(self, command: str, *words: str) -> str:
        """What the command prints; fails where the command does."""
        environment = os.environ | {"TMPDIR": str(self.folder)}
        line = self.buildah(*words, command=command)
        ended = subprocess.run(line, env=environment, capture_output=True, text=True, check=False)
        assert ended.returncode == 0, ended.stdout + ended.stderr
        return ended.stdout.strip()

    def machine(self) -> list[str]:
        """The options that lend this machine's programs and packages to a step."""
        lent = {"/usr", sys.base_prefix, str(self.index), str(ROOT / ".venv")}
        return ["--isolation", "chroot", *(f"--volume={path}:{path}:ro" for path in sorted(lent))]


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Images]:
    folder = tmp_path_factory.mktemp("images")
    index = folder / "index"
    index.mkdir()
    for path in Path(sysconfig.get_path("purelib")).iterdir():
        if "noctule" not in path.name:
            (index / path.name).symlink_to(path)
    made = Images(folder, index)
    root = folder / "base"
    for name in ("etc", "tmp"):
        (root / name).mkdir(parents=True)
    (root / "tmp").chmod(0o1777)
    for name in ("bin", "lib", "lib64"):
        (root / name).symlink_to(f"usr/{name}")
    (root / "etc/passwd").write_text("root:x:0:0::/:/bin/sh\n")
    container = made.ran("from", "scratch")
    made.ran("add", "--quiet", container, str(root), "/")
    made.ran("config", f"--env=PATH={PATH}", f"--env=PYTHONPATH={index}", "--env=PIP_NO_INDEX=1", container)
    made.ran("commit", "--quiet", "--rm", container, BASE)
    yield made
    shutil.rmtree(folder)


@pytest.fixture(scope="module")
def container(images: Images, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A container of the image, built by the README's command but for the program's name."""
    project = tmp_path_factory.mktemp("project")
    packages = [line for line in (ROOT / "Makefile").read_text().splitlines() if line.startswith("WHEELS := ")]
    for package in packages[0].removeprefix("WHEELS := ").split():
        build = [UV, "build", "--quiet", "--wheel", "--package", package, "--out-dir", str(project / "dist")]
        subprocess.run(build, cwd=ROOT, check=True)
    listed = [UV, "export", "--quiet", "--frozen", "--no-dev", "--all-packages", "--no-emit-workspace", "--no-hashes"]
    subprocess.run([*listed, "--output-file", str(project / "dist/constraints.txt")], cwd=ROOT, check=True)
    images.ran("bud", *images.machine(), "--pull-never", "--file", str(FILE), "--tag", "noctule", str(project))
    return images.ran("from", "--pull-never", "localhost/noctule")


def test_each_program_runs_in_the_image_as_nobody(images: Images, container: str) -> None:
    def run(*command: str) -> str:
        # buildah looks a name up before it lends the machine's programs; env does so with the image's own PATH.
        return images.ran("run", *images.machine(), container, "--", "/usr/bin/env", *command)

    assert run("id", "-u") == NOBODY
    own = ("noctule", "noctule-gateway", "noctule-mapper", "noctule-viewer", "noctule-deploy")
    assert [run(name, "--version") for name in own] == [f"{name} 0.1.0" for name in own]
    venv = Path(words("RUN")[2 + words("RUN").index("-m")])
    assert run("sh", "-c", "command -v noctule") == f"{venv}/bin/noctule"
    assert "No broken requirements" in run("pip", "check")
    assert "dist" not in run("ls", "/tmp").split()  # the wheels are gone


def test_a_rendered_gateway_serves_in_the_image_as_the_owner_of_its_files(
    images: Images, container: str, tmp_path: Path
) -> None:
    assert CliRunner().invoke(cli.app, ["init", str(tmp_path)]).exit_code == 0
    place = Place(tmp_path / "rendered", tmp_path / "ca")
    render.render(fleet_file.load(tmp_path / "fleet.toml"), place, datetime.now(UTC))
    host = tmp_path / "rendered/attic-pi"
    data = host / "data"
    data.mkdir()
    for path in [host, *host.rglob("*")]:
        os.chown(path, OWNER, OWNER)
    text = (host / "compose.yaml").read_text()
    service = json.loads(text[text.index("{") :])["services"]["gateway-attic"]
    mounted = [volume.replace("./", f"{host}/", 1) for volume in service["volumes"]]
    options = [*images.machine(), *(f"--volume={volume}" for volume in mounted), f"--user={OWNER}:{OWNER}"]
    command = images.buildah(*options, container, "--", *service["command"], command="run")
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=os.environ | {"TMPDIR": str(tmp_path)}
    ) as run:
        try:
            owner = data / "gateway.attic/owner.json"
            wait_until(lambda: owner.exists() or run.poll() is not None, "the gateway has not taken its folder")
            assert run.poll() is None, run.stderr and run.stderr.read()
            assert owner.stat().st_uid == OWNER
        finally:
            run.terminate()
            run.communicate(timeout=PATIENCE_S)
