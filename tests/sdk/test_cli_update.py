"""``noctule update`` as an operator runs it, on a real router; the units are stand-ins that answer as gateways do."""

import json
import signal
import subprocess
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
import zenoh
from sdk.conftest import NOCTULE, FarEnd, Router, until_answered
from typer.testing import CliRunner, Result

from noctule import bus, keys
from noctule.cli import commands
from noctule.errors import ImageVersionError, NotServedError
from noctule.messages_pb2 import CommandReply, CommandRequest, UnitStatus

TIMEOUT_S = 120.0
NEWER = "0.9.0"


def record(address: int, data: bytes) -> str:
    body = bytes([len(data), address >> 8, address & 0xFF, 0]) + data
    return f":{(body + bytes([-sum(body) & 0xFF])).hex().upper()}\n"


def image_of(version: tuple[int, int, int]) -> str:
    """What firmware/README.md ("Flash") calls a description, at its place in an image, in two records."""
    description = bytes([0x49, 0x4E, 1, *version, 0, 0])
    return record(0x1000, b"\2") + record(0x7FE0, description[:3]) + record(0x7FE3, description[3:]) + ":00000001FF\n"


class Units:
    """Units on the bus that can be updated. ``trouble`` says in which words a unit fails, ``asked`` who was asked."""

    def __init__(self, session: zenoh.Session, names: list[str]) -> None:
        self.asked: list[str] = []
        self.trouble: dict[str, str] = {}
        self.comes_back = True  # with the new version
        self.under_way: set[str] = set()  # who says so the next time
        self.silent = threading.Event()  # a unit that is asked gives no answer while this is set
        self._waiting: list[zenoh.Query] = []
        self._states = {
            name: bus.StatePublisher(session, keys.unit_status("house", name), UnitStatus) for name in names
        }
        for name in names:
            self.tell(name, "0.2.0")
            session.declare_queryable(keys.rpc("house", name, "update"), partial(self._answer, name))
        self._tokens = [session.liveliness().declare_token(keys.alive("house", name)) for name in names]

    def tell(self, unit: str, firmware: str) -> None:
        self._states[unit].put(UnitStatus(site="house", unit=unit, firmware=firmware, state=UnitStatus.STATE_IDLE))

    def _answer(self, unit: str, query: zenoh.Query) -> None:
        self.asked.append(unit)
        assert query.payload is not None
        request = CommandRequest.FromString(query.payload.to_bytes())
        reply = CommandReply(request_id=request.request_id)
        if self.silent.is_set():
            self._waiting.append(query)
            return
        if unit in self.under_way:
            self.under_way.discard(unit)
            reply.error, reply.under_way = "the unit is being updated", True
        elif why := self.trouble.get(unit):
            reply.error = why
        else:
            reply.done, reply.detail = True, f"0.2.0 -> {NEWER}"
            if self.comes_back:
                self.tell(unit, NEWER)
        with query:
            query.reply(query.key_expr, reply.SerializeToString())


@pytest.fixture
def units(far: FarEnd, router: Router) -> Units:
    made = Units(far.session, ["u1", "u2", "u3", "u4"])
    until_answered(router.session, keys.rpc("house", "u4", "update"))
    return made


@pytest.fixture
def image(tmp_path: Path) -> Path:
    """An image of version 0.9.0."""
    path = tmp_path / "update.hex"
    path.write_text(image_of((0, 9, 0)))
    return path


@pytest.fixture
def update(image: Path, router: Router) -> Callable[..., Result]:
    """Runs ``noctule update`` in this process."""
    environment = {"NOCTULE_CONNECT": router.endpoint, "COLUMNS": "150"}

    def run(*options: str) -> Result:
        return CliRunner().invoke(commands, ["update", str(image), "--site", "house", *options], env=environment)

    return run


def outcomes(lines: str) -> dict[str, tuple[str, str]]:
    """Of JSON lines: unit to outcome and reason."""
    results = map(json.loads, lines.splitlines())
    return {each["unit"]: (each["outcome"], each["reason"]) for each in results}


def test_a_site_is_updated_in_groups_and_each_unit_has_a_line(units: Units, update) -> None:
    units.under_way = {"u3"}  # an earlier campaign was stopped
    run = update("--first", "1", "--group", "2")
    assert run.exit_code == 0, run.output
    assert units.asked[0] == "u1"
    assert sorted(units.asked[1:3]) == ["u2", "u3"]
    assert sorted(units.asked[3:]) == ["u3", "u4"]
    assert "updating u2, u3 to 0.9.0" in run.stderr
    rows = [line.split("│")[1].strip() for line in run.stdout.splitlines() if "updated" in line]
    assert rows == ["u1", "u2", "u3", "u4"]


def test_a_campaign_halts_and_the_same_command_goes_on_when_the_cause_is_gone(units: Units, update) -> None:
    units.trouble["u2"] = "the line was cut"
    run = update("--first", "2", "--retries", "1", "--json")
    assert run.exit_code == 3, run.output
    assert sorted(units.asked) == ["u1", "u2", "u2"]
    assert outcomes(run.stdout) == {
        "u1": ("updated", "0.2.0 -> 0.9.0"),
        "u2": ("failed", "the line was cut"),
        "u3": ("not tried", ""),
        "u4": ("not tried", ""),
    }
    assert "halted: 1 of the 2 units of group 1 failed" in run.stderr
    units.trouble.clear()
    units.asked.clear()
    again = update("--json")
    assert again.exit_code == 0, again.output
    assert sorted(units.asked) == ["u2", "u3", "u4"]
    assert outcomes(again.stdout)["u1"] == ("up to date", "")


def test_ctrl_c_ends_the_command_at_once_and_names_what_is_under_way(units: Units, image: Path, router: Router) -> None:
    units.silent.set()
    command = (*NOCTULE, "update", str(image), "--site", "house")
    options = ("--first", "1", "--json", "--connect", router.endpoint)
    with subprocess.Popen([*command, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "updating u1 to 0.9.0\n"
        process.send_signal(signal.SIGINT)
        lines, told = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 130, told
    assert outcomes(lines)["u1"] == ("under way", "its gateway goes on with the update")
    assert outcomes(lines)["u2"] == ("not tried", "")


def test_a_unit_that_says_done_but_is_not_served_again_has_failed(units: Units, update) -> None:
    units.comes_back = False
    run = update("--unit", "u1", "--retries", "0", "--served-within-s", "0.5", "--json")
    assert run.exit_code == 3
    told = "updated, but 0.5 s later it is not served with 0.9.0 (idle, 0.2.0)"
    assert outcomes(run.stdout)["u1"] == ("failed", told)


def test_a_unit_that_no_gateway_serves_is_told_and_the_others_are_updated(units: Units, update) -> None:
    run = update("--unit", "u1", "--unit", "u9", "--json")
    assert run.exit_code == 1
    assert outcomes(run.stdout) == {"u1": ("updated", "0.2.0 -> 0.9.0"), "u9": ("away", "no gateway serves it")}
    assert units.asked == ["u1"]


def test_a_file_that_is_no_image_is_refused_before_anything_is_asked(units: Units, update, image: Path) -> None:
    image.write_text("hello\n:zz\n:0000\n")
    with pytest.raises(
        ImageVersionError, match=r"update\.hex does not say which firmware it is: give build/update\.hex"
    ):
        raise update().exception
    assert units.asked == []


def test_a_site_without_units_on_the_bus_is_told(update) -> None:
    with pytest.raises(NotServedError, match="site 'house' has no units on the bus"):
        raise update().exception
