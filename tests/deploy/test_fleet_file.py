"""The fleet file: what is wrong with it is told by file, table, key and what was meant."""

import re
from itertools import pairwise
from pathlib import Path

import pytest
from typer.testing import CliRunner

from noctule_deploy import cli, fleet, fleet_file, hosts
from noctule_deploy.errors import FleetFileError
from noctule_viewer import memory_limit

SOUND = """
[[router]]
name = "one"
address = "router-1.example.net"

[[gateway]]
name = "attic"
site = "house"
units = ["u1", "u2"]

[[mapper]]
name = "cartographer"
sites = ["house"]

[[service]]
name = "tracker"
sites = ["house"]
tracks = [{ site = "house", unit = "u2" }]
"""

ONE_UNIT = 'site = "house"\n[[unit]]\nname = "u1"\nserial = 1\naddress = "/dev/ttyUSB0"\npose = "key"\n'

MISTAKES = {
    "a key that looks like another": (
        8,
        'site = "house"',
        'siet = "house"',
        "[[gateway]] 1: siet is not known here: did you mean site?",
    ),
    "a key of no use": (
        4,
        'name = "one"',
        'name = "one"\ncolour = "red"',
        "[[router]] 1: colour is not known here: correct or remove it (known: address, host, listen, name, port)",
    ),
    "a table of no use": (11, "[[mapper]]", "[[maper]]", "maper is not known here: did you mean mapper?"),
    "a key that is missing": (2, 'address = "router-1.example.net"', "", "[[router]] 1: address is missing: add it"),
    "a name with capitals": (
        7,
        'name = "attic"',
        'name = "Attic"',
        "[[gateway]] 1: name is 'Attic': use lower-case letters, digits, '-' and '_'",
    ),
    "a unit with a blank": (9, '"u1", "u2"', '"u1", "u 2"', "[[gateway]] 1: units[1] is 'u 2': use lower-case letters"),
    "no unit": (9, '["u1", "u2"]', "[]", "[[gateway]] 1: units is []:"),
    "an address with a port": (
        4,
        "router-1.example.net",
        "router-1:7447",
        "[[router]] 1: address is 'router-1:7447': give a host name or an IP address; the port is a key of its own",
    ),
    "a port as text": (4, 'name = "one"', 'name = "one"\nport = "7447"', "[[router]] 1: port is '7447':"),
    "a site that nobody serves": (
        13,
        'sites = ["house"]',
        'sites = ["houze"]',
        "[[mapper]] 1: sites has 'houze', which no gateway serves: did you mean house?",
    ),
    "a tracked unit that nobody serves": (
        18,
        'unit = "u2"',
        'unit = "u3"',
        "[[service]] 1: tracks unit 'u3' of site 'house', which no gateway serves: add it to a gateway, or correct it",
    ),
    "two of one name": (7, 'name = "tracker"', 'name = "attic"', "name 'attic' is given 2 times"),
    "no TOML": (0, "[[router]]", "[[router]", "is not a TOML file: "),
}


def refusal(folder: Path, text: str) -> list[str]:
    """The lines in which a fleet file of this text is refused."""
    file = folder / "fleet.toml"
    file.write_text(text)
    with pytest.raises(FleetFileError) as refused:
        fleet_file.load(file)
    return str(refused.value).splitlines()


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_told_with_its_place_and_what_was_meant(mistake: str, tmp_path: Path) -> None:
    line, right, wrong, told = MISTAKES[mistake]
    assert right in SOUND
    said = refusal(tmp_path, SOUND.replace(right, wrong, 1))
    where = f"{tmp_path / 'fleet.toml'}, line {line}: " if line else ""
    assert any(each.startswith(where) and told in each for each in said)


def test_every_mistake_is_named_in_the_order_of_the_lines(tmp_path: Path) -> None:
    wrong = SOUND.replace("site =", "siet =", 1).replace('address = "router-1', 'adress = "router-1')
    lines = [re.sub(r".*, line (\d+): .*", r"\1", each) for each in refusal(tmp_path, wrong)]
    assert lines == ["2", "4", "6", "8"]  # address is missing, adress not known; site is missing, siet not known


def test_a_table_within_a_table_is_named(tmp_path: Path) -> None:
    viewer = '[[viewer]]\nname = "hall"\nsites = ["house"]\n[viewer.web]\nname = "map.example.net"\n'
    users = 'users = { anna = "secret" }\nprot = 8443\n'
    said = refusal(tmp_path, SOUND + viewer + users)
    assert "line 25: [[viewer]] 1: web.prot is not known here: did you mean port?" in said[1]
    assert "line 24: [[viewer]] 1: web.users.anna is 'secret': write the hash of a password" in said[0]


HOSTED = {
    "a host without a site file": ('host = "pi"', "host is given and site_file is not"),
    "a site file that is not there": ('site_file = "hose.toml"', "hose.toml is not there: a path is relative to"),
    "a site file with other units": ('site_file = "one-unit.toml"', "one-unit.toml has u1: a gateway serves all units"),
    "an adapter of no unit": ('adapters = { u3 = "A5" }', "adapters has u3, which units does not have"),
    "an adapter of two units": ('adapters = { u1 = "A5", u2 = "A5" }', "adapter 'A5' is given to 2 units"),
    "an adapter that is no number": ('adapters = { u1 = "A 5" }', "copy ID_SERIAL_SHORT of udevadm info"),
    "a router that is none": ('router = "uno"', "router is 'uno', which is no [[router]]"),
    "a host with the authority's name": ('host = "ca"', "the authority's folder has this name"),
}


@pytest.mark.parametrize("mistake", HOSTED)
def test_what_does_not_fit_together_on_a_host_is_told(mistake: str, tmp_path: Path) -> None:
    (tmp_path / "one-unit.toml").write_text(ONE_UNIT)
    written, told = HOSTED[mistake]
    assert told in "\n".join(
        refusal(tmp_path, SOUND.replace('units = ["u1", "u2"]', f'units = ["u1", "u2"]\n{written}'))
    )


VIEWER = """
[[viewer]]
name = "hall"
sites = ["house"]
host = "box"
"""
MAPPER = """
[[mapper]]
name = "sharer"
sites = ["*"]
host = "box"
"""
BARN = '[[gateway]]\nname = "barn"\nsite = "farm"\nunits = ["u1"]\n'
WEB = f"""
[viewer.web]
name = "map.example.net"
users = {{ anna = "$2b$04${"a" * 53}" }}
"""
BESIDE = {
    "a folder that no service can read": (
        'folder = "/home/noctule"\n' + SOUND + VIEWER,
        "folder is '/home/noctule': the hosts' programs read /etc/noctule only",
    ),
    "a folder with a blank": ('folder = "/etc/noctule/a bus"\n' + SOUND + VIEWER, "without blanks"),
    "a folder that leads elsewhere": ('folder = "/etc/noctule/../x"\n' + SOUND + VIEWER, "give a folder there"),
    "a memory limit that keeps no map": (
        SOUND + VIEWER + 'memory_limit = "7MB"',
        "memory_limit is '7MB': write it as 64MB or 1GB; a relay needs 8MB to keep a map",
    ),
    "a page on the port of its files": (
        SOUND + VIEWER + WEB + "port = 9090",
        "web.port is 9090, which viewer 'hall' of the same host has as its web_port: give another",
    ),
    "a viewer of one port": (
        SOUND + VIEWER + "web_port = 9876",
        "web_port is 9876, which viewer 'hall' of the same host has as its port: give another",
    ),
    "a member with the name of a gateway's router": (
        SOUND.replace('site = "house"', 'site = "house"\nrouter = "one"', 1).replace("cartographer", "one"),
        "[[mapper]] 1: name 'one' is that of the router which gateway 'attic' is: give this table another",
    ),
    "a mapper that the viewer beside it may not show": (
        SOUND + BARN + VIEWER + MAPPER,
        "[[mapper]] 2: no viewer of host 'box' (hall) has all sites of this mapper, so none shows its maps",
    ),
    "all sites where there is none": (
        '[[router]]\nname = "one"\naddress = "one"\n' + MAPPER,
        '[[mapper]] 1: sites has "*", and no gateway serves a site: add a [[gateway]]',
    ),
}


@pytest.mark.parametrize("mistake", BESIDE)
def test_what_does_not_go_together_beside_each_other_is_told(mistake: str, tmp_path: Path) -> None:
    text, told = BESIDE[mistake]
    said = refusal(tmp_path, text)
    assert len(said) == 1 and told in said[0]


def test_a_mapper_draws_on_the_viewer_of_its_host_that_has_its_sites(tmp_path: Path) -> None:
    other = VIEWER.replace("hall", "farm-screen").replace("house", "farm")
    own = VIEWER.replace('["house"]', '["house", "farm"]') + "port = 9976\nweb_port = 9190\n"
    file = tmp_path / "fleet.toml"
    file.write_text(SOUND + BARN + other + own + MAPPER)
    commands = {each.name: each.command for each in hosts.programs(fleet_file.load(file))}
    mapper, viewers = commands["sharer"], [commands["hall"], commands["farm-screen"]]
    assert mapper[mapper.index("--rerun") + 1] == "rerun+http://127.0.0.1:9976/proxy#sites"
    watched = [[site for word, site in pairwise(viewer) if word == "--site"] for viewer in viewers]
    assert watched == [["house", "farm"], ["farm"]]


def test_a_mapper_that_says_itself_where_it_draws_needs_no_viewer(tmp_path: Path) -> None:
    file = tmp_path / "fleet.toml"
    file.write_text(SOUND + BARN + VIEWER + MAPPER + 'options = ["--rerun", "none"]\n')
    assert len(fleet_file.load(file).mapper) == 2


def test_a_relays_least_memory_is_that_of_the_viewer() -> None:
    assert fleet.LEAST_MEMORY_MB == memory_limit.LEAST_MB


def test_an_adapter_and_the_units_address_must_be_one(tmp_path: Path) -> None:
    (tmp_path / "one-unit.toml").write_text(ONE_UNIT)
    text = SOUND.replace('["u1", "u2"]', '["u1"]\nsite_file = "one-unit.toml"\nadapters = { u1 = "A5" }')
    (said,) = refusal(tmp_path, text.replace('unit = "u2"', 'unit = "u1"'))
    assert "has '/dev/ttyUSB0': write address = '/dev/noctule/u1' there" in said


def test_one_unit_has_one_gateway(tmp_path: Path) -> None:
    file = tmp_path / "fleet.toml"
    file.write_text(SOUND + '[[gateway]]\nname = "loft"\nsite = "house"\nunits = ["u2"]\n')
    with pytest.raises(FleetFileError, match="unit 'u2' of site 'house' has 2 gateways: keep it with one"):
        fleet_file.load(file)


def test_a_file_with_a_byte_order_mark_and_carriage_returns_is_read(tmp_path: Path) -> None:
    file = tmp_path / "fleet.toml"
    file.write_bytes(b"\xef\xbb\xbf" + SOUND.replace("\n", "\r\n").encode())
    assert fleet_file.load(file).subjects() == ["router.one", "gateway.attic", "mapper.cartographer", "service.tracker"]


def test_init_writes_an_example_that_can_be_rendered_and_never_writes_over_a_file(tmp_path: Path) -> None:
    run = CliRunner().invoke
    assert run(cli.app, ["init", str(tmp_path / "new")]).exit_code == 0
    file = tmp_path / "new" / "fleet.toml"
    assert {member.role for member in fleet_file.load(file).members()} == set(fleet.Role)
    assert run(cli.app, ["render", str(file), "--out", str(tmp_path / "rendered")]).exit_code == 0
    assert run(cli.app, ["check", str(file), "--out", str(tmp_path / "rendered")]).output == "all is well\n"
    file.write_text("mine")
    assert run(cli.app, ["init", str(file.parent)]).exit_code == 1
    assert file.read_text() == "mine"
