"""Keys of firmware images: made once, named in the fleet file, and rendered into the gateways' folders."""

import re
import stat
from pathlib import Path

import pytest
from deploy.secured_fleet import SecuredFleet, rendered
from typer.testing import CliRunner

from noctule import firmware_rules, firmware_signature
from noctule_deploy import cli

IMAGE = ":021000000210DC\n:00000001FF\n"


def deploy(*arguments: str | Path) -> str:
    """What the command prints, on a good end or a bad one."""
    result = CliRunner().invoke(cli.app, [*map(str, arguments)])
    return f"{result.output}{result.exception or ''}"


def on(made: SecuredFleet) -> tuple[str | Path, ...]:
    return (made.file, "--out", made.place.out, "--ca", made.place.ca)


def with_rules(made: SecuredFleet) -> set[str]:
    return {path.parent.name for path in made.place.out.rglob(firmware_rules.FILE)}


def test_a_signed_image_passes_the_rules_that_a_gateway_gets(tmp_path: Path) -> None:
    made, key, image = rendered(tmp_path), tmp_path / "Release 1.pem", tmp_path / "update.hex"
    assert with_rules(made) == set()
    printed = deploy("firmware-key", key)
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    (line,) = re.findall(r"^\[firmware.keys\]\n(.*)$", printed, re.MULTILINE)
    sound = made.file.read_text()
    made.file.write_text(f'{sound}\n[firmware]\noldest = "0.9.0"\n[firmware.keys]\n{line}\n')
    assert deploy("check", *on(made)).count("firmware.toml does not fit the fleet file: run noctule-deploy render") == 4
    deploy("render", *on(made))
    assert with_rules(made) == {"gateway.attic.g1", "gateway.barn.g1", "router.one.g1", "router.two.g1"}
    assert deploy("check", *on(made)).startswith("all is well")

    image.write_text(IMAGE)
    rules = firmware_rules.load(made.folder("gateway.attic.g1") / firmware_rules.FILE)
    assert rules.oldest == (0, 9, 0)
    assert firmware_rules.chosen(None, made.folder("gateway.attic.g1")) == rules
    assert firmware_rules.chosen(None, made.folder("operator.anna.g1")) is None
    assert deploy("firmware-sign", image, "--key", key) == f"{image} is signed by key {rules.keys[0].id}\n"
    assert firmware_signature.check(image.read_bytes(), rules.keys).name == "release-1"

    made.file.write_text(sound)
    deploy("render", *on(made))
    assert with_rules(made) == set()


def test_a_key_is_never_overwritten_and_none_that_others_may_read_signs(tmp_path: Path) -> None:
    key, image = tmp_path / "release.pem", tmp_path / "update.hex"
    image.write_text(IMAGE)
    deploy("firmware-key", key)
    assert "is there already: name another file" in deploy("firmware-key", key)
    key.chmod(0o644)
    assert "(mode 0644): chmod 600" in deploy("firmware-sign", image, "--key", key)
    key.chmod(0o600)
    image.write_text("<html>")
    assert "update.hex was not signed: it has no end record" in deploy("firmware-sign", image, "--key", key)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('oldest = "0.9"\nkeys = {}', "[firmware]: oldest is '0.9': write a version as 0.9.0"),
        ("keys = {}", "[firmware]: keys is {}"),
        ('keys = { release = "eA==" }', "[firmware.keys]: release is 'eA==': copy what noctule-deploy firmware-key"),
        ('oldset = "0.9.0"', "[firmware]: oldset is not known here: did you mean oldest?"),
    ],
)
def test_a_mistake_in_the_table_of_firmware_is_named(tmp_path: Path, table: str, words: str) -> None:
    made = rendered(tmp_path)
    made.file.write_text(f"{made.file.read_text()}\n[firmware]\n{table}\n")
    assert words in deploy("render", *on(made))
