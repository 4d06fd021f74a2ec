"""A host's install.sh as root would run it, below a folder: what it changes, starts, removes and refuses.

systemd, pip and Python are stubs that write down how they are called; the shell, the files and the script are real.
"""

import shutil
import subprocess
from datetime import UTC, datetime
from pathlib import Path

import pytest
from typer.testing import CliRunner

from noctule_deploy import cli, fleet_file, render
from noctule_deploy.render import Place

STUBS = ("systemctl", "systemd-sysusers", "systemd-tmpfiles", "udevadm", "caddy")
PYTHON = """\
#!/bin/sh
case $1 in
-V) cat "{version}"; exit ;;
esac
echo "python3 $*" >>"{log}"
rm -rf "$4"
mkdir -p "$4/bin"
cp "{pip}" "$4/bin/pip"
"""
SERVICES = "noctule-viewer-hall-screen.service noctule-mapper-mapper-1.service noctule-web-hall-screen.service"
MARK = "# Made by noctule-deploy render. Change the fleet file, not this file.\n"


class Host:
    """The host ``server`` of the example: its folder and dist in a home, its root beside them."""

    def __init__(self, folder: Path) -> None:
        assert CliRunner().invoke(cli.app, ["init", str(folder / "fleet")]).exit_code == 0
        rendered = Place(folder / "rendered", folder / "ca")
        render.render(fleet_file.load(folder / "fleet/fleet.toml"), rendered, datetime(2026, 3, 1, tzinfo=UTC))
        self.home, self.root, self._stubs = folder / "home", folder / "root", folder / "stubs"
        self._log, self._version = folder / "calls", folder / "version"
        self._version.write_text("Python 3.11.2\n")
        shutil.copytree(rendered.out / "server", self.home / "server")
        (self.home / "dist").mkdir()
        for package in ("noctule", "noctule_mapper", "noctule_viewer"):
            self.wheel(package, "0.1.0")
        (self.home / "dist/constraints.txt").write_text("")
        self._stubs.mkdir()
        for name in (*STUBS, "pip"):
            self.mend(name)
        self._stub("id", "#!/bin/sh\necho 0\n")
        paths = {"version": self._version, "log": self._log, "pip": self._stubs / "pip"}
        self._stub("python3", PYTHON.format(**paths))
        self._below_the_root(self.home / "server/install.sh")

    def _below_the_root(self, script: Path) -> None:
        text = script.read_text()
        for there, here in (
            ("root=${DESTDIR:-}\n", f"root={self.root}\n"),
            ("/usr/bin/python3", f"{self._stubs}/python3"),
            ("/usr/bin/caddy", f"{self._stubs}/caddy"),
        ):
            assert there in text
            text = text.replace(there, here)
        script.write_text(text)

    def _stub(self, name: str, text: str) -> None:
        (self._stubs / name).write_text(text)
        (self._stubs / name).chmod(0o755)

    def wheel(self, package: str, version: str) -> Path:
        path = self.home / "dist" / f"{package}-{version}-py3-none-any.whl"
        path.write_text(version)
        return path

    def fail_at(self, name: str) -> None:
        """From now on a command fails, as if the run were cut off there."""
        self._stub(name, "#!/bin/sh\nexit 1\n")

    def mend(self, name: str) -> None:
        """It succeeds and writes down how it is called."""
        self._stub(name, f'#!/bin/sh\necho "{name} $*" >>"{self._log}"\n')

    def lacks(self, name: str) -> None:
        (self._stubs / name).unlink()

    def has_python(self, version: str) -> None:
        self._version.write_text(version)

    def install(self) -> subprocess.CompletedProcess[str]:
        self._log.write_text("")
        path = f"{self._stubs}:/usr/bin:/bin"
        command = ["sh", "server/install.sh", "dist"]
        return subprocess.run(command, cwd=self.home, env={"PATH": path}, capture_output=True, text=True, check=False)

    def installed(self) -> list[str]:
        """The calls of a run that succeeds."""
        ended = self.install()
        assert ended.returncode == 0, ended.stdout + ended.stderr
        return self.calls()

    def calls(self) -> list[str]:
        return self._log.read_text().splitlines()

    def put(self, path: str, text: str = "") -> Path:
        """A file that is on the host already."""
        file = self.root / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        return file


@pytest.fixture
def host(tmp_path: Path) -> Host:
    return Host(tmp_path)


def test_the_first_run_installs_and_starts_all_and_the_second_only_sees_that_all_runs(host: Host) -> None:
    first = host.installed()
    assert [each.split()[0] for each in first[:3]] == ["python3", "pip", "pip"]
    assert f"systemctl restart {SERVICES}" in first
    second = host.installed()
    assert f"systemctl start {SERVICES}" in second
    assert not [each for each in second if each.startswith(("python3", "pip", "systemctl restart"))]


@pytest.mark.parametrize("cut_off_at", ["systemd-sysusers", "systemctl"])
def test_after_a_run_that_was_cut_off_the_next_one_restarts_what_has_changed(host: Host, cut_off_at: str) -> None:
    host.installed()
    (host.home / "server/etc/noctule/Caddyfile").write_text("new")
    host.fail_at(cut_off_at)
    assert host.install().returncode != 0
    assert (host.root / "etc/noctule/Caddyfile").read_text() == "new"
    host.mend(cut_off_at)
    assert f"systemctl restart {SERVICES}" in host.installed()
    assert f"systemctl start {SERVICES}" in host.installed()


def test_a_certificate_that_is_still_in_the_copied_folder_is_removed_with_its_program(host: Host) -> None:
    stale = "etc/noctule/bus/mapper.old/private.key"
    copied = host.home / "server" / stale
    copied.parent.mkdir()
    copied.write_text("")
    installed = host.put(stale)
    host.installed()
    assert not installed.parent.exists()


def test_wheels_of_two_versions_are_refused_before_anything_changes(host: Host) -> None:
    host.wheel("noctule_mapper", "0.2.0")
    ended = host.install()
    assert ended.returncode == 1
    assert "dist has 2 versions of a package" in ended.stderr and "remove the folder" in ended.stderr
    assert host.calls() == [] and not host.root.exists()


def test_a_wheel_that_is_not_there_is_named(host: Host) -> None:
    host.wheel("noctule_viewer", "0.1.0").unlink()
    ended = host.install()
    assert ended.returncode == 1
    assert "dist/noctule_viewer-*.whl is not there: make wheels" in ended.stderr


def test_a_program_that_the_host_needs_and_has_not_is_named(host: Host) -> None:
    host.lacks("caddy")
    ended = host.install()
    assert (ended.returncode, ended.stderr) == (1, "install.sh: apt-get install caddy\n")


def test_what_was_installed_by_hand_stays(host: Host) -> None:
    own = [
        host.put("etc/noctule/bus/private.key"),
        host.put("etc/noctule/bus/mapper.mapper-1.g1/private.key"),
        host.put("etc/noctule/bus/service.door-alarm/private.key"),
        host.put("etc/systemd/system/noctule-lights.service", "[Service]\nExecStart=/bin/true\n"),
    ]
    calls = host.installed()
    assert all(each.exists() for each in own)
    assert not [each for each in calls if each.startswith("systemctl disable")]


def test_a_program_that_has_left_the_host_is_stopped_and_debians_caddy_may_run_again_without_a_page(host: Host) -> None:
    left = host.put("etc/systemd/system/noctule-web-old.service", MARK)
    calls = host.installed()
    assert "systemctl disable --now noctule-web-old.service" in calls
    assert "systemctl unmask caddy.service" in calls
    assert not left.exists()


def test_debians_caddy_never_holds_the_ports_of_a_page(host: Host) -> None:
    calls = host.installed()
    assert calls.index("systemctl mask --now caddy.service") < calls.index(f"systemctl restart {SERVICES}")
    assert "Conflicts" not in (host.root / "etc/systemd/system/noctule-web-hall-screen.service").read_text()


def test_another_python_gets_a_new_environment(host: Host) -> None:
    host.installed()
    host.has_python("Python 3.12.3\n")
    calls = host.installed()
    assert calls[0] == f"python3 -m venv --clear {host.root}/opt/noctule"
    assert f"systemctl restart {SERVICES}" in calls


def test_a_careful_roots_umask_keeps_no_service_from_its_files(host: Host) -> None:
    script = host.home / "server/install.sh"
    script.write_text(f"umask 077\n{script.read_text()}")
    host.installed()
    for folder in ("etc", "etc/noctule", "etc/noctule/bus/mapper.mapper-1", "opt/noctule/bin", "var/lib/noctule"):
        assert (host.root / folder).stat().st_mode & 0o777 == 0o755
