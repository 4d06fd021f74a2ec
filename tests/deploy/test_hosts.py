"""What render makes for each host, held against the programs that read it: systemd, udev, Caddy, Zenoh, the shell."""

import json
import re
import shlex
import stat
import subprocess
from datetime import UTC, datetime
from pathlib import Path

import pytest
import yaml
import zenoh
from system.processes import PATIENCE_S, ROOT
from typer.testing import CliRunner

from noctule import tls
from noctule_deploy import check, cli, fleet_file, render
from noctule_deploy.caddy import caddyfile
from noctule_deploy.fleet import Viewer, Web
from noctule_deploy.render import Place

NOW = datetime(2026, 3, 1, tzinfo=UTC)
MORE = """
[[router]]
name = "router-2"
address = "hub.example.net"
host = "hub"

[[mapper]]
name = "mapper-2"
sites = ["*"]
host = "hub"
options = ["--config", "/etc/noctule/100 %.toml"]
"""
UNITS = (
    "noctule-gateway-attic",
    "noctule-mapper-mapper-1",
    "noctule-mapper-mapper-2",
    "noctule-router-router-2",
    "noctule-viewer-hall-screen",
    "noctule-web-hall-screen",
)
ANOTHER_SYSTEMD = 0.2  # the README has the figures of systemd 252; others weigh a little differently
SOUND = 2.0  # a service of whose faults an attacker gets little; one without any bound has 9.6


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Place]:
    """The example of init with a second router, which is zenohd, rendered at NOW."""
    folder = tmp_path_factory.mktemp("hosts")
    assert CliRunner().invoke(cli.app, ["init", str(folder)]).exit_code == 0
    file = folder / "fleet.toml"
    file.write_text(file.read_text() + MORE)
    place = Place(folder / "rendered", folder / "ca")
    render.render(fleet_file.load(file), place, NOW)
    return file, place


def unit_files(place: Place) -> dict[str, Path]:
    return {path.stem: path for path in place.out.glob("*/etc/systemd/system/*.service")}


def ran(*command: str | Path, env: dict[str, str] | None = None) -> str:
    """What the command prints; fails where the command does."""
    ended = subprocess.run(
        [*map(str, command)], capture_output=True, text=True, timeout=PATIENCE_S, check=False, env=env
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout + ended.stderr


def test_each_host_gets_its_programs_and_nothing_of_the_others(made: tuple[Path, Place]) -> None:
    _, place = made
    assert sorted(unit_files(place)) == sorted(UNITS)
    bus = {path.relative_to(place.out).parts[::4] for path in place.out.glob("*/etc/noctule/bus/*")}
    assert bus == {
        ("attic-pi", "router.router-1"),
        ("hub", "router.router-2"),
        ("hub", "mapper.mapper-2"),
        ("server", "mapper.mapper-1"),
        ("server", "viewer.hall-screen"),
    }
    keys = list(place.out.glob("*/etc/noctule/bus/*/private.key"))
    assert {stat.S_IMODE(each.stat().st_mode) for each in keys} == {0o600}


def test_systemd_finds_nothing_wrong_with_the_units(made: tuple[Path, Place], tmp_path: Path) -> None:
    for unit in unit_files(made[1]).values():
        # The programs are not in the places of a host here, which systemd would say.
        copy = tmp_path / unit.name
        copy.write_text(re.sub(r"^ExecStart=\S+", "ExecStart=/bin/true", unit.read_text(), flags=re.MULTILINE))
    assert ran("systemd-analyze", "verify", "--man=no", *sorted(tmp_path.iterdir())) == ""


@pytest.mark.parametrize("unit", UNITS)
def test_a_units_exposure_is_what_the_readme_states(made: tuple[Path, Place], unit: str) -> None:
    judged = ran("systemd-analyze", "security", "--offline=yes", unit_files(made[1])[unit])
    (exposure,) = re.findall(r"Overall exposure level for .*: (\d+\.\d)", judged)
    stated = stated_exposure(unit.split("-")[1])
    assert abs(float(exposure) - stated) <= ANOTHER_SYSTEMD
    assert stated <= SOUND


def stated_exposure(role: str) -> float:
    """What the README's table says of the services of a role."""
    rows = re.findall(r"^\| (\w+)[^|]* \|[^|]*\| (\d+\.\d) \|$", (ROOT / "deploy/README.md").read_text(), re.MULTILINE)
    return float(dict(rows)[role])


def test_a_command_line_says_the_same_to_systemd_as_to_us(made: tuple[Path, Place]) -> None:
    text = unit_files(made[1])["noctule-mapper-mapper-2"].read_text()
    (command,) = re.findall(r"^ExecStart=(.*)$", text, re.MULTILINE)
    assert command.startswith(
        "/opt/noctule/bin/noctule-mapper run --site house --data /var/lib/noctule/mapper.mapper-2"
    )
    assert command.endswith('--tls /etc/noctule/bus/mapper.mapper-2 --rerun none --config "/etc/noctule/100 %%.toml"')


def test_the_udev_rule_names_the_adapter_by_its_serial_number(made: tuple[Path, Place]) -> None:
    (rules,) = made[1].out.glob("*/etc/udev/rules.d/*")
    assert rules.parts[-5] == "attic-pi" and rules.name > "60-serial.rules"
    (rule,) = [line for line in rules.read_text().splitlines() if not line.startswith("#")]
    pairs = [re.fullmatch(r'([A-Z]+(?:\{\w+\})?)(==|!=|\+=|=)"([^"]*)"', each) for each in rule.split(", ")]
    assert [each and each.groups() for each in pairs] == [
        ("ACTION", "!=", "remove"),
        ("SUBSYSTEM", "==", "tty"),
        ("ENV{ID_SERIAL_SHORT}", "==", "A50285BI"),
        ("SYMLINK", "+=", "noctule/u1"),
        ("GROUP", "=", "dialout"),
        ("MODE", "=", "0660"),
    ]


def test_caddy_takes_its_configuration(made: tuple[Path, Place], tmp_path: Path) -> None:
    file = made[1].out / "server/etc/noctule/Caddyfile"
    home = {"HOME": str(tmp_path), "XDG_DATA_HOME": str(tmp_path), "PATH": "/usr/bin"}
    assert "Valid configuration" in ran("caddy", "validate", "--adapter", "caddyfile", "--config", file, env=home)


def test_the_containers_of_a_host_run_the_commands_of_its_units(made: tuple[Path, Place]) -> None:
    for host in ("attic-pi", "server", "hub"):
        compose = yaml.safe_load((made[1].out / host / "compose.yaml").read_text())["services"]
        units = [path for path in unit_files(made[1]).values() if host in path.parts]
        assert sorted(compose) == sorted(path.stem.removeprefix("noctule-") for path in units)
        for path in units:
            (line,) = re.findall(r"^ExecStart=(.*)$", path.read_text(), re.MULTILINE)
            service = compose[path.stem.removeprefix("noctule-")]
            command = shlex.split(line.replace("%%", "%"))
            assert service["command"] == (command[1:] if "router" in path.stem else command)
            assert (service["read_only"], service["cap_drop"], service["network_mode"]) == (True, ["ALL"], "host")
    gateway = yaml.safe_load((made[1].out / "attic-pi/compose.yaml").read_text())["services"]["gateway-attic"]
    assert gateway["devices"] == ["/dev/noctule/u1:/dev/noctule/u1"]


def test_a_gateway_may_open_the_devices_of_its_site_file(tmp_path: Path) -> None:
    assert CliRunner().invoke(cli.app, ["init", str(tmp_path)]).exit_code == 0
    for name, right, wrong in (
        ("house.toml", '"/dev/noctule/u1"', '"/dev/ttyAMA0"'),
        ("fleet.toml", "adapters =", "# adapters ="),
    ):
        file = tmp_path / name
        assert right in file.read_text()
        file.write_text(file.read_text().replace(right, wrong))
    place = Place(tmp_path / "rendered", tmp_path / "ca")
    render.render(fleet_file.load(tmp_path / "fleet.toml"), place, NOW)
    assert "\nDeviceAllow=/dev/ttyAMA0 rw\n" in unit_files(place)["noctule-gateway-attic"].read_text()
    services = yaml.safe_load((place.out / "attic-pi/compose.yaml").read_text())["services"]
    assert services["gateway-attic"]["devices"] == ["/dev/ttyAMA0:/dev/ttyAMA0"]
    assert services["gateway-attic"]["group_add"] == ["dialout"]


def test_caddy_takes_a_page_whose_name_is_an_address(tmp_path: Path) -> None:
    web = Web(name="fd00::5", users={"anna": f"$2b$04${'a' * 53}"})
    file = tmp_path / "Caddyfile"
    file.write_text(caddyfile(Viewer(name="hall", sites=["house"], web=web), web))
    home = {"HOME": str(tmp_path), "XDG_DATA_HOME": str(tmp_path), "PATH": "/usr/bin"}
    adapted = json.loads(ran("caddy", "adapt", "--adapter", "caddyfile", "--config", file, env=home).splitlines()[0])
    (server,) = adapted["apps"]["http"]["servers"].values()
    assert server["listen"] == [":443"]
    assert server["routes"][0]["match"] == [{"host": ["fd00::5"]}]


def test_zenoh_takes_every_configuration_and_its_files_are_where_the_host_has_them(made: tuple[Path, Place]) -> None:
    files = list(made[1].out.glob("*/etc/noctule/bus/*/zenoh.json5"))
    assert len(files) == 5
    for file in files:
        config = zenoh.Config.from_file(str(file))
        named = json.loads(config.get_json("transport/link/tls"))
        own = "/" + str(file.parent.relative_to(made[1].out).relative_to(file.relative_to(made[1].out).parts[0]))
        assert named["connect_certificate"] == f"{own}/{tls.CERTIFICATE}"


def test_the_check_sees_a_hosts_file_that_was_changed_or_is_of_no_use(made: tuple[Path, Place]) -> None:
    file, place = made
    fleet = fleet_file.load(file)
    assert check.check(fleet, place, NOW) == []
    unit = unit_files(place)["noctule-router-router-2"]
    sound = unit.read_text()
    unit.write_text(sound.replace("NoNewPrivileges=yes", "NoNewPrivileges=no"))
    stale = unit.with_name("noctule-gateway-gone.service")
    stale.write_text("")
    assert [each.text.split(":")[0] for each in check.check(fleet, place, NOW)] == [
        f"{unit} does not fit the fleet file",
        f"{stale} is of no use to host hub",
    ]
    assert render.render(fleet, place, NOW) == [place.out / "hub"]
    assert unit.read_text() == sound and not stale.exists()
    assert render.render(fleet, place, NOW) == []


def test_a_renewed_certificate_reaches_the_folder_of_its_host(made: tuple[Path, Place]) -> None:
    file, place = made
    touched = render.renew(fleet_file.load(file), place, "mapper.mapper-1", NOW)
    assert place.out / "server" in touched
    pem = (place.out / "server/etc/noctule/bus/mapper.mapper-1" / tls.CERTIFICATE).read_bytes()
    assert pem == (place.out / "mapper.mapper-1.g2" / tls.CERTIFICATE).read_bytes()


def test_the_script_puts_every_file_into_its_place_and_none_the_second_time(
    made: tuple[Path, Place], tmp_path: Path
) -> None:
    host, root = made[1].out / "server", tmp_path / "root"
    retired = [root / "etc/noctule/bus" / each for each in ("mapper.mapper-1/firmware.toml", "mapper.old/private.key")]
    for each in retired:
        each.parent.mkdir(parents=True)
        each.write_text("")
    install = ("sh", host / "install.sh")
    ran(*install, env={"DESTDIR": str(root), "PATH": "/usr/bin:/bin"})
    for path in (host / "etc").rglob("*"):
        if path.is_file():
            placed = root / path.relative_to(host)
            assert placed.read_bytes() == path.read_bytes()
            assert stat.S_IMODE(placed.stat().st_mode) == stat.S_IMODE(path.stat().st_mode)
    assert not any(each.exists() for each in retired)
    assert ran(*install, env={"DESTDIR": str(root), "PATH": "/usr/bin:/bin"}) == ""
