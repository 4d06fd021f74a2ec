"""The audit log under floods: its size is bounded, and a flood hides nothing that was recorded before it."""

import json
import os
import time
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import pytest
from gateway.audited import ANNA, close, facts, look, record

from noctule.caller import Who
from noctule.messages_pb2 import CommandReply, CommandRequest
from noctule_gateway.audit import allowance, lines
from noctule_gateway.audit.allowance import CALLERS, COMMANDS, DAY_S, KEPT_AT_LEAST_S, REFUSALS, Allowance, Keeping, Sum
from noctule_gateway.audit.audit_log import AuditLog
from noctule_gateway.bus.recorded_commands import RecordedCommands

SMALL = replace(COMMANDS, max_file_bytes=2_000, max_bytes=10_000, burst_bytes=10**6)


def sizes(folder: Path, family: str = "audit") -> list[int]:
    return [path.stat().st_size for _, path in lines.files(folder, family)]


def test_its_size_is_bounded_and_the_oldest_files_go_first(tmp_path: Path) -> None:
    log = record(tmp_path, 300, SMALL)
    assert sum(sizes(tmp_path)) <= 2 * 10_000 and max(sizes(tmp_path)) <= 2_000 + 300
    assert lines.files(tmp_path)[0][0] > 1
    found = look(tmp_path)
    assert (found.trouble, found.last) == ("", log.recorded)
    assert found.first > 1


def test_a_file_of_the_last_thirty_days_stays_until_twice_the_size_and_an_older_one_goes(tmp_path: Path) -> None:
    record(tmp_path, 70, SMALL)
    assert 10_000 < sum(sizes(tmp_path)) <= 20_000
    assert lines.files(tmp_path)[0][0] == 1
    for _, path in lines.files(tmp_path):
        os.utime(path, (0, time.time() - KEPT_AT_LEAST_S - 60))
    record(tmp_path, 1, SMALL)
    assert sum(sizes(tmp_path)) <= 10_000
    assert (look(tmp_path).trouble, lines.files(tmp_path)[0][0] > 1) == ("", True)


@pytest.mark.parametrize("keeping", [COMMANDS, REFUSALS])
def test_no_flood_fills_a_log_within_thirty_days(keeping: Keeping) -> None:
    most = Sum(0.0)
    for number in range(20):
        made_up = f"{number}" + "\U0001f987" * 64  # JSON makes twelve bytes of a bat
        most.add({"event": "refused", "unit": made_up, "command": made_up, "who": '"' * number + "\x01" * 64})
    longest_sum = len(json.dumps(most.facts())) + 200
    assert longest_sum * DAY_S / allowance.SUM_UP_EVERY_S <= keeping.bytes_per_day / 2  # the common budget pays
    days = KEPT_AT_LEAST_S / DAY_S
    most_written = keeping.burst_bytes + days * keeping.bytes_per_day + longest_sum
    assert most_written + keeping.max_file_bytes <= keeping.max_bytes


def test_a_flood_is_summed_up_and_washes_out_nothing_that_was_recorded_before(tmp_path: Path) -> None:
    keeping = replace(REFUSALS, max_bytes=60_000, burst_bytes=10_000, bytes_per_day=1_000, max_file_bytes=5_000)
    now_s = 0.0
    log = AuditLog(tmp_path, {}, keeping, now_s=lambda: now_s)
    log.append({"event": "refused", "who": "the first"}).result(60)
    refusals = 15_000
    for number in range(refusals):
        now_s = number * KEPT_AT_LEAST_S / refusals
        log.append({"event": "refused", "unit": "u1", "command": "home", "who": f"session {number % 2}"})
    close(log)
    assert log.lost == 0
    assert sum(sizes(tmp_path, "refused")) <= keeping.max_bytes
    recorded = facts(tmp_path, "refused")
    assert recorded[1]["who"] == "the first"
    sums = [each for each in recorded if each["event"] == "summed up"]
    whole = [each for each in recorded if each["event"] == "refused"]
    assert len(whole) + sum(each["count"] for each in sums) == 1 + refusals
    assert sum(each["count"] for each in sums) == log.summed_up
    assert {kind["who"] for each in sums for kind in each["kinds"]} == {"session 0", "session 1"}
    assert str(look(tmp_path)).startswith("log of refusals: ") and look(tmp_path).trouble == ""


def test_a_command_that_is_only_counted_is_carried_out_all_the_same(tmp_path: Path) -> None:
    log = AuditLog(tmp_path, {}, replace(COMMANDS, burst_bytes=0, bytes_per_day=0))
    reply: Future[CommandReply] = Future()
    reply.set_result(CommandReply(done=True))
    given = RecordedCommands(lambda *_: reply, log, "u1").carry_out("stop", CommandRequest(request_id="r1"), ANNA)
    assert given.result(60).done
    close(log)
    assert facts(tmp_path)[1]["kinds"] == [
        {"event": "given", "unit": "u1", "command": "stop", "who": "operator.anna.g1", "count": 1},
    ]


def carried_out(*_: object) -> Future[CommandReply]:
    reply: Future[CommandReply] = Future()
    reply.set_result(CommandReply(done=True))
    return reply


class Flooded:
    """A log in which anna sets 2 waypoints a second, in a time of the test's own."""

    def __init__(self, folder: Path, keeping: Keeping = COMMANDS) -> None:
        self._folder, self._now_s, self._given = folder, 0.0, 0
        self._log = AuditLog(folder, {}, keeping, now_s=lambda: self._now_s)
        self._commands = RecordedCommands(carried_out, self._log, "u1")

    def give(self, command: str, who: Who) -> None:
        self._given += 1
        request = CommandRequest(request_id=f"r{self._given:06}", waypoint=3)
        assert self._commands.carry_out(command, request, who).result(60).done

    def flood(self, count: int, who: Who = ANNA, command: str = "set_waypoint") -> None:
        for _ in range(count):
            self._now_s += 0.5
            self.give(command, who)

    def end(self) -> list[lines.Facts]:
        close(self._log)
        return facts(self._folder)


# Small, so that a flood of some hundred commands is enough: 16 shares of half of it are 2 kB each, and a line in 20 s.
TIGHT = replace(COMMANDS, max_bytes=10_000_000, burst_bytes=64_000, bytes_per_day=3_456_000)


def test_a_flood_that_lasts_has_both_lines_of_a_command_or_none(tmp_path: Path) -> None:
    flooded = Flooded(tmp_path, TIGHT)
    flooded.flood(2000)
    recorded = flooded.end()
    given = [each["request_id"] for each in recorded if each["event"] == "given"]
    done = [each["request_id"] for each in recorded if each["event"] == "done"]
    assert given == done
    assert sum(request_id > "r001000" for request_id in given) >= 5  # later, too, as the budget is refilled


@pytest.mark.parametrize(
    ("command", "who"),
    [
        ("stop", Who("operator.bert.g1", signed=True)),
        ("update", ANNA),
        ("calibrate", Who("session 1", signed=False)),
    ],
)
def test_a_flood_by_one_operator_hides_no_other_ones_command_and_no_grave_one(
    tmp_path: Path, command: str, who: Who
) -> None:
    flooded = Flooded(tmp_path, TIGHT)
    flooded.flood(500)
    flooded.give(command, who)
    recorded = flooded.end()
    (given,) = [each for each in recorded if each["event"] == "given" and each["command"] == command]
    assert given["who"] == who.name
    assert [each["event"] for each in recorded if each.get("request_id") == given["request_id"]] == ["given", "done"]


def test_callers_who_make_up_names_share_one_budget_and_an_operator_who_comes_late_has_an_own_one() -> None:
    now_s = 0.0
    budgets = Allowance(TIGHT, lambda: now_s)

    def line(who: str, signed: bool) -> lines.Facts:
        return {"event": "given", "who": who, "signed": signed, "command": "stop"}

    while budgets.admit(line("anna", True)):
        pass
    strangers = sum(budgets.admit(line(f"session {number}", False)) is not None for number in range(1000))
    assert 5 <= strangers <= 15  # 2 kB, of which RESERVE_BYTES stay
    for number in range(CALLERS + 5):
        assert (budgets.admit(line(f"operator {number}", True)) is not None) == (number < CALLERS - 1)
    now_s = KEPT_AT_LEAST_S
    while budgets.admit(line("anna", True)):
        pass
    assert budgets.admit(line("who comes late", True)) is not None
    assert budgets.admit(line("anna", True)) is None


def test_a_sum_says_how_many_others_there_were_beside_the_kinds_that_it_names() -> None:
    told = Sum(0.0)
    for number in range(8):
        told.add({"event": "given", "unit": f"u{number}", "command": "stop", "who": "anna"})
    line = told.facts()
    assert (line["count"], line["others"]) == (8, 3)
    assert sum(kind["count"] for kind in line["kinds"]) == 5
