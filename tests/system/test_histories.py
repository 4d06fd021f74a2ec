"""Nothing is lost: kills, freezes, full disks, pulled lines, set clocks and new routers in histories drawn from seeds.

``python -m system.histories`` plays them by hand and makes a failing one small.
"""

import math
import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from system.histories import faults
from system.histories.cable import Witness
from system.histories.checker import LogExtent, findings, held_sweeps
from system.histories.faults import Fault, History
from system.histories.shrink import shrink
from system.processes import ROOT

from noctule import messages_pb2 as messages
from noctule.messages_pb2 import Cursor
from noctule.site import Site, load
from noctule_gateway.clock.boot_clocks import SweepTime
from noctule_gateway.clock.regression import HostTime
from noctule_gateway.wire.frames import NO_TEMPERATURE, NO_WAYPOINT, NoEcho, Reading, Sweep
from noctule_gateway.wire.sweep_message import to_message
from noctule_mapper.config import Window
from noctule_mapper.live.store import SweepStore

SOAKED = range(200)  # the seeds of the soak's histories
SWEEPS = 20
DRIFT = 0.015  # the most by which a unit's oscillator is off: datasheet of the C8051F340
WHOLE = LogExtent("log-1", head=SWEEPS, tail=1)
SITE = """
site = "attic"
[[unit]]
name = "u1"
serial = 1
address = "socket://127.0.0.1:9"
pose = { x_m = 0.0, y_m = 0.0, heading_deg = 0.0 }
"""
OVERLAPPING = [
    Fault(0.0, 1.5, "router", "replaced"),
    Fault(0.2, 2.0, "u1", "pulled"),
    Fault(0.5, 1.0, "gateway", "killed"),
    Fault(0.7, 2.0, "mapper", "frozen"),
    Fault(0.8, 1.5, "clock", "set", hours=-7.0),
    Fault(1.8, 1.0, "gateway", "disk full"),
]


# ---- The checker, and that it can fail ------------------------------------------------------------------------------


def made_sweep(number: int) -> Sweep:
    """A sweep with bearings at both ends of their range, an echo and none."""
    readings = (Reading(-32768, 0, 40_000 + number), Reading(32767, 15_000, NoEcho.NO_ECHO), Reading(0, 30_000, 1))
    return Sweep(1, number, 7, 5, 1000 * number, NO_WAYPOINT, NO_TEMPERATURE, 0, readings)


@pytest.fixture
def site(tmp_path: Path) -> Site:
    (tmp_path / "site.toml").write_text(SITE)
    return load(tmp_path / "site.toml")


def message_of(sweep: Sweep, site: Site, log_sequence: int) -> messages.Sweep:
    """The sweep as the gateway logs it."""
    pose = messages.Pose(x_m=0.0, y_m=0.0, heading_rad=0.0)
    when = SweepTime(HostTime(1.7e9 + log_sequence, 1e-3), DRIFT, 1 + DRIFT)
    message = to_message(sweep, site, site.units[0], when, pose)
    message.log_id, message.log_sequence = WHOLE.log_id, log_sequence
    return message


@pytest.fixture
def store(tmp_path: Path, site: Site) -> Path:
    """A mapper's store that holds every sweep of the unit."""
    path = tmp_path / "store.sqlite3"
    sweeps = [message_of(made_sweep(number), site, number + 1) for number in range(SWEEPS)]
    with closing(SweepStore(path, Window(sweeps_per_place=SWEEPS + 1, max_age_s=1e9))) as opened:
        opened.commit(sweeps, [Cursor(unit="u1", log_id=WHOLE.log_id, log_sequence=SWEEPS)])
    return path


@pytest.fixture
def witness() -> Witness:
    """What stood at the unit's end of the line, and saw every sweep acknowledged."""
    made = {(1, number): made_sweep(number) for number in range(SWEEPS)}
    return Witness(made, set(made))


def change(store: Path, statement: str, *values: object) -> None:
    with closing(sqlite3.connect(store)) as database, database:
        assert database.execute(statement, values).rowcount == 1


def found(store: Path, witness: Witness, log: LogExtent = WHOLE) -> list[str]:
    return findings("u1", witness, held_sweeps(store).get("u1", []), log)


def test_a_store_that_holds_every_sweep_once_as_it_was_made_is_found_sound(store: Path, witness: Witness) -> None:
    assert found(store, witness) == []


def test_a_sweep_taken_out_of_the_store_is_found(store: Path, witness: Witness) -> None:
    change(store, "DELETE FROM sweep WHERE log_sequence = 8")
    assert found(store, witness) == [
        "u1: 1 handed over and not held, 0 of them removed by retention (log log-1, 1 to 20): boot 1 sequence 7"
    ]


def test_a_sweep_that_only_the_unit_still_has_is_not_missed(store: Path, witness: Witness) -> None:
    change(store, "DELETE FROM sweep WHERE log_sequence = 20")
    witness.handed_over.remove((1, 19))
    assert found(store, witness) == []


def test_a_sweep_that_is_in_the_store_twice_is_found(store: Path, witness: Witness, site: Site) -> None:
    again = message_of(made_sweep(7), site, 21).SerializeToString()
    change(
        store,
        "INSERT INTO sweep SELECT unit, log_id, 21, clock_epoch, start_ns, entered_elapsed_s, visit, place_x_m, "
        "place_y_m, place_heading_rad, ?, checksum FROM sweep WHERE log_sequence = 8",
        again,
    )
    assert found(store, witness) == ["u1: held more than once: boot 1 sequence 7"]


@pytest.mark.parametrize(
    "altered",
    [
        replace(made_sweep(7), readings=made_sweep(8).readings),
        replace(made_sweep(7), readings=made_sweep(7).readings[:2]),
        replace(made_sweep(7), readings=(Reading(-32767, 0, 40_007), *made_sweep(7).readings[1:])),
        replace(made_sweep(7), readings=(Reading(-32768, 0, NoEcho.NO_ECHO), *made_sweep(7).readings[1:])),
        replace(made_sweep(7), waypoint=3),
    ],
    ids=["another echo", "a reading less", "another bearing", "no echo", "another waypoint"],
)
def test_a_sweep_altered_in_the_store_is_found(store: Path, witness: Witness, site: Site, altered: Sweep) -> None:
    record = message_of(altered, site, 8).SerializeToString()
    change(store, "UPDATE sweep SET record = ? WHERE log_sequence = 8", record)
    assert found(store, witness) == ["u1: held, and altered: boot 1 sequence 7"]


def test_a_sweep_that_no_unit_has_made_is_found(store: Path, witness: Witness) -> None:
    del witness.made[1, 7]
    witness.handed_over.remove((1, 7))
    assert found(store, witness) == ["u1: held, and never made: boot 1 sequence 7"]


def test_what_retention_removed_unread_is_counted_and_no_more_than_that_may_be_missing(
    store: Path, witness: Witness
) -> None:
    for log_sequence in (1, 2):
        change(store, "DELETE FROM sweep WHERE log_sequence = ?", log_sequence)
    assert found(store, witness, replace(WHOLE, tail=3)) == []
    assert len(found(store, witness, replace(WHOLE, tail=2))) == 1
    change(store, "DELETE FROM sweep WHERE log_sequence = 9")  # in the log still
    assert len(found(store, witness, replace(WHOLE, tail=3))) == 1


# ---- Histories and how a failing one is made small ------------------------------------------------------------------


def test_a_seed_gives_the_same_history_each_time_and_a_file_gives_it_back() -> None:
    drawn = faults.draw(7)
    assert drawn == faults.draw(7) != faults.draw(8)
    assert faults.read_json(faults.to_json(drawn)) == drawn


def test_the_histories_of_the_soak_have_every_kind_of_fault_and_faults_that_overlap() -> None:
    drawn = [faults.draw(seed) for seed in SOAKED]
    kinds = {("line" if fault.target in faults.UNITS else fault.target, fault.kind) for each in drawn for fault in each}
    assert kinds == set(faults.WEIGHTS)
    overlapping = [
        each for each in drawn if max(len(faults.at(each, moment_s)) for moment_s in faults.moments_s(each)) > 1
    ]
    assert len(overlapping) > 150


def test_a_failing_history_shrinks_to_the_faults_that_it_takes() -> None:
    drawn = [fault for seed in range(4) for fault in faults.draw(seed)]
    needed = {drawn[1], drawn[8]}
    tries: list[History] = []

    def fails(history: History) -> bool:
        tries.append(history)
        return needed <= set(history)

    assert shrink(drawn, fails) == [drawn[1], drawn[8]]
    assert len(tries) < len(drawn) * math.log2(len(drawn))


# ---- Histories played -----------------------------------------------------------------------------------------------


def play(*arguments: str) -> str:
    """Play histories on hosts of their own, and give what was printed; fails if the checker finds anything."""
    command = [sys.executable, "-m", "system.histories", *arguments]
    told = subprocess.run(
        command, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT / "tests")}, capture_output=True, text=True
    )
    assert told.returncode == 0, told.stdout + told.stderr
    assert ": 0 findings in" in told.stdout
    return told.stdout


def test_faults_of_every_program_that_overlap_cost_no_sweep(tmp_path: Path) -> None:
    (tmp_path / "history.json").write_text(faults.to_json(OVERLAPPING))
    play("--faults", str(tmp_path / "history.json"))


@pytest.mark.soak
@pytest.mark.parametrize(
    ("seeds", "keep_s"), [(SOAKED[:160], 3600), (SOAKED[160:], 8)], ids=["160, all kept", "40, 8 s kept"]
)
def test_histories_drawn_from_seeds_cost_no_sweep_that_retention_does_not_count(seeds: range, keep_s: float) -> None:
    """A history takes some 2 s of a processor. For more of either kind: ``PYTHONPATH=tests python -m system.histories
    --seeds 200-399 --hosts 6``, with ``--keep-s 8`` for the other.
    """
    told = play("--seeds", f"{seeds[0]}-{seeds[-1]}", "--keep-s", str(keep_s), "--hosts", "6")
    assert told.count(": 0 findings in") == len(seeds)
