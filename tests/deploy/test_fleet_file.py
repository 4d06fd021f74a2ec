"""The fleet file: what is wrong with it is told by file, table, key and what was meant."""

from importlib.resources import files
from pathlib import Path

import pytest
from typer.testing import CliRunner

from noctule_deploy import cli, fleet
from noctule_deploy.errors import FleetFileError

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

MISTAKES = {
    "a key that looks like another": (
        'site = "house"',
        'siet = "house"',
        "[[gateway]] 1: siet is not known here: did you mean site?",
    ),
    "a key of no use": (
        'name = "one"',
        'name = "one"\ncolour = "red"',
        "[[router]] 1: colour is not known here: correct or remove it (known: address, listen, name, port)",
    ),
    "a table of no use": ("[[mapper]]", "[[maper]]", "maper is not known here: did you mean mapper?"),
    "a key that is missing": ('address = "router-1.example.net"', "", "[[router]] 1: address is missing: add it"),
    "a name with capitals": (
        'name = "attic"',
        'name = "Attic"',
        "[[gateway]] 1: name is 'Attic': use lower-case letters, digits, '-' and '_'",
    ),
    "a unit with a blank": ('"u1", "u2"', '"u1", "u 2"', "[[gateway]] 1: units[1] is 'u 2': use lower-case letters"),
    "no unit": ('["u1", "u2"]', "[]", "[[gateway]] 1: units is []:"),
    "an address with a port": (
        "router-1.example.net",
        "router-1:7447",
        "[[router]] 1: address is 'router-1:7447': give a host name or an IP address; the port is a key of its own",
    ),
    "a port as text": ('name = "one"', 'name = "one"\nport = "7447"', "[[router]] 1: port is '7447':"),
    "a site that nobody serves": (
        'sites = ["house"]',
        'sites = ["houze"]',
        "[[mapper]] 1: sites has 'houze', which no gateway serves: did you mean house?",
    ),
    "a tracked unit that nobody serves": (
        'unit = "u2"',
        'unit = "u3"',
        "[[service]] 1: tracks unit 'u3' of site 'house', which no gateway serves: add it to a gateway, or correct it",
    ),
    "two of one name": ('name = "tracker"', 'name = "attic"', "name 'attic' is given 2 times"),
    "no TOML": ("[[router]]", "[[router]", "is not TOML: "),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_told_with_its_place_and_what_was_meant(mistake: str, tmp_path: Path) -> None:
    right, wrong, told = MISTAKES[mistake]
    assert right in SOUND
    file = tmp_path / "fleet.toml"
    file.write_text(SOUND.replace(right, wrong, 1))
    with pytest.raises(FleetFileError) as refusal:
        fleet.load(file)
    assert str(refusal.value).startswith(f"{file}: ") or "is not TOML" in str(refusal.value)
    assert told in str(refusal.value)


def test_one_unit_has_one_gateway(tmp_path: Path) -> None:
    file = tmp_path / "fleet.toml"
    file.write_text(SOUND + '[[gateway]]\nname = "loft"\nsite = "house"\nunits = ["u2"]\n')
    with pytest.raises(FleetFileError, match="unit 'u2' of site 'house' has 2 gateways: keep it with one"):
        fleet.load(file)


def test_a_file_with_a_byte_order_mark_and_carriage_returns_is_read(tmp_path: Path) -> None:
    file = tmp_path / "fleet.toml"
    file.write_bytes(b"\xef\xbb\xbf" + SOUND.replace("\n", "\r\n").encode())
    assert fleet.load(file).subjects() == ["router.one", "gateway.attic", "mapper.cartographer", "service.tracker"]


def test_init_writes_an_example_that_can_be_rendered_and_never_writes_over_a_file(tmp_path: Path) -> None:
    file = tmp_path / "fleet.toml"
    run = CliRunner().invoke
    assert run(cli.app, ["init", str(file)]).exit_code == 0
    assert file.read_text() == files("noctule_deploy").joinpath(cli.EXAMPLE).read_text()
    assert {member.role for member in fleet.load(file).members()} == set(fleet.Role)
    file.write_text("mine")
    assert run(cli.app, ["init", str(file)]).exit_code == 1
    assert file.read_text() == "mine"
