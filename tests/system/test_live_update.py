"""``noctule rpc SITE UNIT update`` as an operator runs it: the real firmware, and a gateway that goes on serving."""

import json
import os
import re
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from firmware.images import VERSION, newer_version
from firmware.stepped_unit import IMAGE
from system.processes import PATIENCE_S, Programs, free_ports, programs, wait_until

from noctule.client import Client
from noctule.firmware_rules import FirmwareRules, to_toml
from noctule.firmware_signature import PublicKey, sign
from noctule.messages_pb2 import CommandReply, CommandRequest, Sweep, UnitStatus

SITE = "bench"
KEY = Ed25519PrivateKey.generate()
SPEED, SLOWLY = 4, 1  # an update takes 8 s of the unit's time, so that slowly there is time to do something meanwhile
# One sweep takes some 25 s of the unit's time, so that an update comes during one.
LONG_SWEEP = "sweep = { first_bearing_deg = -120, bearing_step_deg = 3.8, count = 64, pings = 5, start = true }"

# What a gateway says of a busy host whose clock nobody sets, and not of the update.
OF_THE_HOST = ("the host's clock: nothing synchronises it", "serves it late", "served late")


@pytest.fixture(scope="module")
def image(tmp_path_factory) -> Path:
    """The update to version 0.9.0, signed."""
    made = newer_version(tmp_path_factory.mktemp("newer"))
    made.write_bytes(sign(made.read_bytes(), KEY))
    return made


class Bench:
    """A unit and the gateway that serves it."""

    def __init__(self, running: Programs, folder: Path, sweep: str, speed: int) -> None:
        self.running = running
        unit_port, bus_port = free_ports(2)
        self.endpoint = f"tcp/127.0.0.1:{bus_port}"
        self.statuses: list[UnitStatus] = []
        site = folder / "site.toml"
        site.write_text(
            f'site = "{SITE}"\nclock = "unit"\nair_temperature_c = 21.0\n'
            f'[[unit]]\nname = "u1"\nserial = 1\naddress = "socket://127.0.0.1:{unit_port}"\n'
            f"pose = {{ x_m = 0.0, y_m = 0.0, heading_deg = 0.0 }}\n{sweep}\n"
        )
        simulator = f"noctule-sim --firmware {IMAGE} --laps 0 --speed {speed} --tcp 127.0.0.1:{unit_port}"
        running.start("simulator", *simulator.split())
        rules = folder / "firmware.toml"
        rules.write_text(to_toml(FirmwareRules((PublicKey("release", KEY.public_key().public_bytes_raw()),))))
        where = f"--data {folder}/data --listen {self.endpoint} --firmware {rules}"
        self._gateway = f"noctule-gateway run {site} {where}".split()
        self.start_gateway()

    def start_gateway(self) -> None:
        self.running.start("gateway", *self._gateway)

    def watch(self, client: Client) -> None:
        """Keep every status from now on."""
        client.on_unit_status(self.statuses.append)

    def wait_for(self, state: "UnitStatus.State", words: str = "") -> UnitStatus:
        """The next status that says so."""
        self.statuses.clear()

        def found() -> UnitStatus | None:
            self.running.check()
            return next((each for each in self.statuses if each.state == state and words in each.detail), None)

        return wait_until(found, f"no status {state} {words!r}")

    def rpc(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        """``noctule rpc``."""
        command = ["noctule", "rpc", "--json", SITE, "u1", *map(str, arguments), "--connect", self.endpoint]
        return subprocess.run(
            command, capture_output=True, text=True, timeout=2 * PATIENCE_S, env=os.environ | {"COLUMNS": "200"}
        )


@contextmanager
def bench(folder: Path, sweep: str = "", speed: int = SPEED) -> Iterator[Bench]:
    with programs(folder) as running:
        yield Bench(running, folder, sweep, speed)


def test_a_unit_that_sweeps_is_updated_and_loses_no_sweep(tmp_path: Path, image: Path) -> None:
    with bench(tmp_path, LONG_SWEEP) as at, Client(SITE, connect=[at.endpoint]) as client:
        at.watch(client)
        for _ in range(2):  # a second apart, and so some way into the first sweep
            before = at.wait_for(UnitStatus.STATE_SWEEPING)
        at.statuses.clear()
        done = at.rpc("update", "--image", image)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["detail"] == f"{VERSION} -> 0.9.0"
        told = [each for each in at.statuses if each.detail.startswith("updating: ")]
        assert any("sending, " in each.detail and " pages" in each.detail for each in told), told
        assert {each.state for each in told} == {UnitStatus.STATE_LOADER}
        (whole_before,) = {each.log_head for each in told}  # none but on a busy machine, where the command comes late
        after = at.wait_for(UnitStatus.STATE_SWEEPING)
        assert after.firmware == "0.9.0"
        assert not after.detail or any(words in after.detail for words in OF_THE_HOST), after.detail

        def logged() -> list[Sweep]:
            return list(client.history("u1"))[: whole_before + 2]

        wait_until(lambda: len(logged()) == whole_before + 2, "no sweep after it")
        *earlier, cut, whole = logged()
        numbers = [(each.boot, each.sequence, each.log_sequence) for each in (*earlier, cut)]
        assert numbers == [(before.boot, number, number + 1) for number in range(whole_before + 1)]
        assert 0 < len(cut.readings) < 64
        assert (whole.boot, whole.sequence, len(whole.readings)) == (after.boot, 0, 64)
        warnings = [line for line in at.running.log("gateway").splitlines() if "WARNING" in line]
        assert not [line for line in warnings if not any(words in line for words in OF_THE_HOST)]
        again = at.rpc("update", "--image", image)
        assert json.loads(again.stdout)["detail"] == "has 0.9.0; --force sends it again"


def test_one_request_is_one_update_and_other_commands_are_told_to_wait(tmp_path: Path, image: Path) -> None:
    with bench(tmp_path, speed=SLOWLY) as at, Client(SITE, connect=[at.endpoint]) as client:
        at.watch(client)
        at.wait_for(UnitStatus.STATE_IDLE)
        replies: list[CommandReply] = []

        def update() -> None:
            request = CommandRequest(request_id="same", image=image.read_bytes())
            replies.append(client.command("u1", "update", request, timeout_s=PATIENCE_S))

        asking = [threading.Thread(target=update) for _ in range(2)]
        for each in asking:
            each.start()
        at.wait_for(UnitStatus.STATE_LOADER, "updating: sending")
        for name in ("home", "settings", "update"):
            request = CommandRequest(image=image.read_bytes(), force=True)
            refused = client.command("u1", name, request, timeout_s=PATIENCE_S)
            assert ("is being updated: wait" in refused.error, refused.under_way) == (True, True)
        hello = client.command("u1", "hello", CommandRequest(), timeout_s=PATIENCE_S)
        assert (hello.done, hello.status.state) == (True, UnitStatus.STATE_LOADER)
        for each in asking:
            each.join()
        update()  # the reply is remembered
        assert replies == [CommandReply(request_id="same", done=True, detail=f"{VERSION} -> 0.9.0")] * 3
        assert at.running.log("gateway").count("its firmware is being updated") == 1


def test_what_is_no_image_is_refused_in_words_and_the_unit_is_left_alone(tmp_path: Path) -> None:
    with bench(tmp_path) as at, Client(SITE, connect=[at.endpoint]) as client:
        at.watch(client)
        before = at.wait_for(UnitStatus.STATE_IDLE)
        refused = at.rpc("update", "--image", IMAGE)
        assert refused.returncode != 0
        assert "the image, line 1: 0x0000 is outside the application's pages" in refused.stderr
        unsigned = at.rpc("update", "--image", IMAGE.with_name("update.hex"))
        assert "the image was not taken: it is not signed: sign it" in unsigned.stderr
        assert "image is empty" in client.command("u1", "update", CommandRequest(), timeout_s=PATIENCE_S).error
        assert at.wait_for(UnitStatus.STATE_IDLE).boot == before.boot


def test_an_update_that_was_cut_off_with_its_gateway_is_done_by_the_next_one(tmp_path: Path, image: Path) -> None:
    with bench(tmp_path, speed=SLOWLY) as at, Client(SITE, connect=[at.endpoint]) as client:
        at.watch(client)
        at.wait_for(UnitStatus.STATE_IDLE)
        asking = threading.Thread(target=lambda: at.rpc("update", "--image", image))
        asking.start()
        at.wait_for(UnitStatus.STATE_LOADER, "updating: sending")
        at.running.kill("gateway")
        asking.join()
        at.start_gateway()
        at.wait_for(UnitStatus.STATE_LOADER, f"update it by noctule rpc {SITE} u1 update --image")
        done = at.rpc("update", "--image", image)
        assert json.loads(done.stdout)["detail"] == f"{VERSION} -> 0.9.0", done.stderr
        assert at.wait_for(UnitStatus.STATE_IDLE).firmware == "0.9.0"


def test_a_gateway_that_is_stopped_says_so_to_who_waits_for_an_update(tmp_path: Path, image: Path) -> None:
    with bench(tmp_path, speed=SLOWLY) as at, Client(SITE, connect=[at.endpoint]) as client:
        at.watch(client)
        at.wait_for(UnitStatus.STATE_IDLE)
        told: list[str] = []
        asking = threading.Thread(target=lambda: told.append(at.rpc("update", "--image", image).stderr))
        asking.start()
        at.wait_for(UnitStatus.STATE_LOADER, "updating: sending")
        assert at.running.end("gateway") == 0
        asking.join()
        assert "update the unit again, it goes on where it was" in told[0]


def test_a_campaign_that_was_stopped_in_the_midst_is_ended_by_the_same_command(tmp_path: Path, image: Path) -> None:
    with bench(tmp_path, speed=SLOWLY) as at, Client(SITE, connect=[at.endpoint]) as client:
        at.watch(client)
        at.wait_for(UnitStatus.STATE_IDLE)
        command = ("noctule", "update", str(image), "--site", SITE, "--json", "--connect", at.endpoint)
        at.running.start("campaign", *command)
        at.wait_for(UnitStatus.STATE_LOADER, "updating: sending")
        assert at.running.end("campaign") == 130, at.running.log("campaign")
        assert '"outcome": "under way"' in at.running.log("campaign")
        at.running.start("again", *command)
        assert at.running.wait("again") == 0, at.running.log("again")
        assert re.search('"outcome": "(updated|up to date)"', at.running.log("again"))  # it may have ended in between
        assert at.wait_for(UnitStatus.STATE_IDLE).firmware == "0.9.0"
        updates = at.running.log("gateway").count(f"the update is over: {VERSION} -> 0.9.0")
        assert updates == 1  # the second found it done
