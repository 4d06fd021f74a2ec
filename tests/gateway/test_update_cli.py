"""``noctule-gateway update`` as an operator runs it, with the real firmware in noctule-sim behind TCP ports."""

import os
import re
import socket
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from firmware.images import VERSION, newer_version
from firmware.stepped_unit import IMAGE
from system.processes import PATIENCE_S

from noctule.firmware_rules import FirmwareRules, to_toml
from noctule.firmware_signature import PublicKey, sign

UNITS = 3
SPEED = "10"


class Bench(NamedTuple):
    """A running simulator: the site file of its units, their ports, and an update for them."""

    site: Path
    ports: list[int]
    image: Path


@pytest.fixture(scope="module")
def image(tmp_path_factory) -> Path:
    return newer_version(tmp_path_factory.mktemp("newer"))


@pytest.fixture
def bench(tmp_path, image) -> Iterator[Bench]:
    options = ["--firmware", IMAGE, "--units", str(UNITS), "--laps", "0", "--speed", SPEED, "--tcp", "127.0.0.1:0"]
    with (
        subprocess.Popen(["noctule-sim", *options], stdout=subprocess.PIPE, text=True) as simulator,
        ExitStack() as ending,
    ):
        ending.callback(simulator.terminate)
        assert simulator.stdout is not None
        ports: list[int] = []
        while len(ports) < UNITS:
            found = re.search(r"^unit \d+: socket://[\d.]+:(\d+)", simulator.stdout.readline())
            assert found
            ports.append(int(found[1]))
        site = tmp_path / "site.toml"
        site.write_text(
            'site = "bench"\n'
            + "".join(
                f'[[unit]]\nname = "u{number}"\nserial = {number}\naddress = "socket://127.0.0.1:{port}"\n'
                "pose = { x_m = 0.0, y_m = 0.0, heading_deg = 0.0 }\n"
                for number, port in enumerate(ports, start=1)
            )
        )
        yield Bench(site, ports, image)


def update(bench: Bench, *options: str) -> subprocess.CompletedProcess[str]:
    command = ["noctule-gateway", "update", bench.site, "--image", bench.image, *options]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE_S, env=os.environ | {"COLUMNS": "300"}
    )


def outcomes(run: subprocess.CompletedProcess[str]) -> dict[str, tuple[str, str]]:
    """The table: unit to outcome and what is said of it."""
    rows = re.findall(r"^│ (\w+) +│ ([\w ]+?) +│ (.*?) +│$", run.stdout, re.MULTILINE)
    return {unit: (outcome, detail) for unit, outcome, detail in rows}


def test_a_site_is_updated_and_then_left_alone(bench):
    first = update(bench)
    assert first.returncode == 0, first.stderr
    assert outcomes(first) == {f"u{number}": ("updated", f"{VERSION} -> 0.9.0") for number in range(1, UNITS + 1)}
    second = update(bench)
    assert second.returncode == 0
    assert {outcome for outcome, _ in outcomes(second).values()} == {"up to date"}


def test_one_unit_is_updated_by_name_and_again_if_it_must_be(bench):
    assert outcomes(update(bench, "--unit", "u2")) == {"u2": ("updated", f"{VERSION} -> 0.9.0")}
    assert outcomes(update(bench, "--unit", "u2", "--force")) == {"u2": ("updated", "0.9.0 -> 0.9.0")}


def test_a_unit_whose_line_is_held_fails_alone_and_the_others_are_updated(bench):
    with socket.create_connection(("127.0.0.1", bench.ports[0])):
        run = update(bench)
    assert run.returncode == 1
    told = outcomes(run)
    assert [told[unit][0] for unit in ("u1", "u2", "u3")] == ["failed", "updated", "updated"]
    assert "A gateway may hold the line: have it do the update, noctule rpc SITE u1 update" in told["u1"][1]


def test_where_there_are_keys_only_a_signed_image_is_sent(bench, tmp_path):
    key = Ed25519PrivateKey.generate()
    rules = tmp_path / "firmware.toml"
    public = PublicKey("release", key.public_key().public_bytes_raw())
    rules.write_text(to_toml(FirmwareRules((public,))))
    refused = update(bench, "--unit", "u1", "--firmware", str(rules))
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "was not taken: it is not signed: sign it (noctule-deploy firmware-sign)" in refused.stderr
    bench.image.with_name("signed.hex").write_bytes(sign(bench.image.read_bytes(), key))
    signed = update(bench._replace(image=bench.image.with_name("signed.hex")), "--unit", "u1", "--firmware", str(rules))
    assert outcomes(signed) == {"u1": ("updated", f"{VERSION} -> 0.9.0")}
    assert f"0.9.0: signed by {public}" in signed.stdout


def test_what_is_no_image_ends_before_any_line_is_opened(bench):
    run = update(bench._replace(image=IMAGE))
    assert run.returncode == 1
    assert "an update takes build/update.hex" in run.stderr
    assert run.stdout == ""


def test_a_unit_that_the_site_does_not_have_is_named(bench):
    run = update(bench, "--unit", "u9")
    assert run.returncode == 1
    assert "has no unit 'u9': it has u1, u2, u3" in run.stderr
