"""One bit flipped, or a cut, in a file of a log whose gateway was killed; and what a reader and the unit then find."""

import shutil
import sqlite3
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

from system.processes import PATIENCE_S

from noctule import elapsed
from noctule.messages_pb2 import Reading, Sweep
from noctule_gateway.errors import LogError
from noctule_gateway.log import head_file
from noctule_gateway.log.head_file import HeadFile
from noctule_gateway.log.log_file import Arrival, Committed, Retention
from noctule_gateway.log.sweep_log import SweepLog

SWEEPS = 90
NAME = "u1.sqlite"
_IN_MEMORY = Path("/dev/shm")


@dataclass(frozen=True)
class KilledLog:
    """The files of a log as a killed gateway left them, part of its commits in the -wal; and what was in it."""

    folder: Path
    log_id: str
    records: dict[int, bytes]
    arrivals: list[Arrival]


def arrival(sequence: int) -> Arrival:
    """A coarse sweep, 13 readings by 22.5 degrees, as a unit makes them."""
    readings = [
        Reading(bearing_rad=0.392699 * step, time_offset_s=0.12 * step, time_of_flight_s=0.01 + 1e-4 * sequence)
        for step in range(-6, 7)
    ]
    sweep = Sweep(site="s", unit="u1", boot=1, sequence=sequence, clock_error_s=0.25, readings=readings)
    sweep.start.FromNanoseconds((1_000_000_000 + sequence) * 10**9)
    return Arrival(sequence.to_bytes(16, "little"), 4_000_000 * sequence, sweep)


def killed_log(folder: Path) -> KilledLog:
    """A log with a third of its commits in the -wal alone."""
    folder.mkdir()
    running = folder / "running"
    running.mkdir()
    log = SweepLog(running / NAME, Retention(), elapsed.now)
    arrivals = [arrival(sequence) for sequence in range(SWEEPS)]
    committed = {}
    for each in arrivals:
        result = _append(log, each)
        assert isinstance(result, Committed)
        committed[result.log_sequence] = result.record
        if len(committed) == 2 * SWEEPS // 3:
            _checkpoint(running / NAME)
    left = folder / "left"
    shutil.copytree(running, left)
    log.close()
    return KilledLog(left, log.state.log_id, committed, arrivals)


def copied_unnoticed(source: Path, folder: Path) -> None:
    """Copy a log's folder, and let its head file know the copy as it knew the log."""
    shutil.copytree(source, folder)
    known_to_head_file(folder / NAME)


def known_to_head_file(path: Path) -> None:
    """Let the head file of a log that was copied know it for the log itself."""
    head = Path(f"{path}-head")
    heads, file = head_file.read(head, ""), HeadFile(head)
    assert heads.newest is not None and heads.reserved is not None
    file.begin(replace(heads.newest, file=head_file.file_identity(path)), heads.reserved.reserved)
    file.close()


def spoil(folder: Path, random: Random) -> str:
    """Flip a bit or cut a file at a place drawn at random; what was done."""
    path = random.choice([each for each in sorted(folder.iterdir()) if each.is_file() and each.stat().st_size])
    text = bytearray(path.read_bytes())
    place = random.randrange(len(text))
    if random.random() < 0.2:
        path.write_bytes(text[:place])
        return f"{path.name} cut at {place}"
    text[place] ^= 1 << random.randrange(8)
    path.write_bytes(text)
    return f"{path.name} flipped at {place}"


def what_broke(left: KilledLog, folder: Path, random: Random) -> str:
    """Spoil a copy of the log in ``folder``, and use it; what went wrong, empty if nothing."""
    copied_unnoticed(left.folder, folder)
    done = spoil(folder, random)
    try:
        log = SweepLog(folder / NAME, Retention(), elapsed.now)
    except Exception as error:
        return f"crash: {error!r} ({done})"
    try:
        wrong = _use(log, left)
    except Exception as error:
        wrong = f"crash: {error!r}"
    finally:
        log.close()
        shutil.rmtree(folder)
    return f"{wrong} ({done})" if wrong else ""


def faults(trials: range) -> tuple[Counter[str], list[str]]:
    """How often each kind of outcome came in the trials of these seeds, and what was wrong.

    The files are in memory where the machine has such a folder: what a trial spoils has reached the disk, and on a disk
    it would mostly wait.
    """
    with tempfile.TemporaryDirectory(dir=_IN_MEMORY if _IN_MEMORY.is_dir() else None) as name:
        folder = Path(name)
        left = killed_log(folder / "log")
        wrong = [what_broke(left, folder / "trial", Random(seed)) for seed in trials]
    return Counter(text.partition(":")[0] or "right" for text in wrong), [text for text in wrong if text]


def _use(log: SweepLog, left: KilledLog) -> str:
    tries: list[Callable[[], str]] = [
        lambda: _read_all(log, left),
        lambda: _resend(log, left),
        lambda: _add(log, left),
        lambda: _read_all(log, left),
    ]
    return next(filter(None, (each() for each in tries)), "")


def _read_all(log: SweepLog, left: KilledLog) -> str:
    """Read as a reader does, from the first sequence on."""
    at, held, lost = 1, set[int](), set[int]()
    log_id = left.log_id
    until_s = time.monotonic() + PATIENCE_S
    while True:
        try:
            log.last_of_boot(1)
            found = log.read(at, 20, 2**20)
        except LogError as error:
            if time.monotonic() > until_s:
                return f"stopped: {error}"
            time.sleep(0.002)
            continue
        if found.log_id != log_id:
            at, held, lost, log_id = found.tail, set(), set(), found.log_id
            continue
        gaps = getattr(found, "gaps", ())
        for gap in gaps:
            lost |= set(range(gap.first, gap.last + 1))
        for record in found.records:
            sweep = Sweep.FromString(record)
            if not _is_as_sent(sweep, left):
                return f"altered: sweep {sweep.log_sequence}"
            held.add(sweep.log_sequence)
        after = max([at - 1, *(Sweep.FromString(record).log_sequence for record in found.records)])
        after = max([after, *(gap.last for gap in gaps if gap.first <= after + 1)])
        if after >= found.head:
            break
        if after < at:
            return f"stopped: head {found.head}, and nothing after {after}"
        at = after + 1
    missing = set(left.records) - held
    if log_id == left.log_id and missing - lost:
        return f"lost: {len(missing - lost)} sweeps in silence"
    if missing and after > SWEEPS and not getattr(log.state, "damage", ""):  # after commits that had to find it
        return f"lost: {len(missing)} sweeps, and the status says nothing"
    return ""


def _is_as_sent(sweep: Sweep, left: KilledLog) -> bool:
    """Whether the record is what its unit sent; under the old log_id also that it stands where it was logged."""
    if sweep.log_id == left.log_id and sweep.log_sequence in left.records:
        return sweep == Sweep.FromString(left.records[sweep.log_sequence])
    sent = Sweep()
    sent.CopyFrom(arrival(sweep.sequence).sweep)
    sent.log_id, sent.log_sequence = sweep.log_id, sweep.log_sequence
    return sweep == sent


def _resend(log: SweepLog, left: KilledLog) -> str:
    for index in (0, SWEEPS // 2, SWEEPS - 1):
        result = _append(log, left.arrivals[index])
        if isinstance(result, LogError):
            return f"stopped: a resend is refused: {result}"
        sweep = Sweep.FromString(result.record)
        sent = Sweep()
        sent.CopyFrom(left.arrivals[index].sweep)
        sent.log_id, sent.log_sequence = sweep.log_id, sweep.log_sequence
        if sweep != sent:
            return "altered: a resend was taken for another sweep"
        if result.fresh and sweep.log_id == left.log_id and sweep.log_sequence in left.records:
            return f"reused: sequence {sweep.log_sequence}"
    return ""


def _add(log: SweepLog, left: KilledLog) -> str:
    for sequence in range(SWEEPS, SWEEPS + 3):
        result = _append(log, arrival(sequence))
        if isinstance(result, LogError):
            return f"stopped: a new sweep is refused: {result}"
        if log.state.log_id == left.log_id and result.log_sequence in left.records:
            return f"reused: sequence {result.log_sequence}"
    return ""


def _append(log: SweepLog, each: Arrival) -> Committed | LogError:
    future: Future[Committed | LogError] = Future()
    log.append(each, future.set_result)
    return future.result(timeout=PATIENCE_S)


def _checkpoint(path: Path) -> None:
    with closing(sqlite3.connect(path)) as db:
        db.execute("PRAGMA wal_checkpoint(PASSIVE)")
