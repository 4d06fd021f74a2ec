"""Long commands say how far they are on a terminal, say nothing of it in a pipe, and end soon after Ctrl-C."""

import os
import pty
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

import psutil
import pytest
from mapper.live_site import paper_survey
from system.processes import free_ports, wait_until

from noctule import survey
from noctule.messages_pb2 import Sweep

BIN = Path(sys.executable).parent
REPRODUCE = ("noctule-mapper", "reproduce", "--seeds", "500", "--jobs", "2", "--out", "figures")
# Where a command has a core to itself, Ctrl-C ends it within a second. Here others run too, so the second is one of
# processor time, of a program that begins at Ctrl-C and competes for the processors as the command does.
SECOND = "import time\nwhile time.process_time() < 1.0: pass"
SITE = """site = "attic"
[[unit]]
name = "zz"
serial = 99
address = "/dev/ttyUSB0"
pose = "unknown"
"""


class OnTerminal:
    """A command on a terminal of its own, started in ``folder``."""

    def __init__(self, folder: Path, *command: str) -> None:
        self._main, far_end = pty.openpty()
        os.set_blocking(self._main, False)
        self.process = subprocess.Popen(
            [str(BIN / command[0]), *command[1:]],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=far_end,
            stderr=far_end,
            env=os.environ | {"TERM": "xterm", "COLUMNS": "100"},
            start_new_session=True,
        )
        os.close(far_end)
        self._shown = ""

    def shown(self) -> str:
        """All that it has written on the terminal."""
        try:
            while part := os.read(self._main, 65536):
                self._shown += part.decode(errors="replace")
        except OSError:  # nothing more yet, or ever
            pass
        return self._shown

    def close(self) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)  # its processes too, if it is gone itself
        self.process.wait()
        os.close(self._main)

    def status_by_ctrl_c(self, group: bool = True) -> int:
        """Its exit status after Ctrl-C, which a terminal sends to its whole ``group``; fails if that takes a second."""
        with subprocess.Popen([sys.executable, "-c", SECOND], start_new_session=True) as second:
            try:
                os.kill(-self.process.pid if group else self.process.pid, signal.SIGINT)
                wait_until(lambda: self._is_over() or second.poll() is not None, "the command's end", every_s=0.02)
                assert self._is_over(), f"it goes on a second after Ctrl-C: {self.shown()}"
            finally:
                second.kill()
        return self.process.returncode

    def _is_over(self) -> bool:
        """It has ended; what it writes until then is read, so that it never waits for that."""
        self.shown()
        return self.process.poll() is not None


def many_sweeps(path: Path, count: int) -> None:
    """The paper's survey over and over, each sweep of a place in the log and a time of its own."""
    round_ = list(paper_survey())
    lines: list[Sweep] = []
    for number in range(count):
        sweep = Sweep()
        sweep.CopyFrom(round_[number % len(round_)])
        sweep.log_id, sweep.log_sequence = "many", number + 1
        sweep.start.FromMilliseconds(1_700_000_000_000 + 1000 * number)
        lines.append(sweep)
    with path.open("w") as stream:
        survey.write(lines, stream)


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A survey with which each command is busy for a second after it has shown how far it is."""
    path = tmp_path_factory.mktemp("many") / "many.jsonl"
    many_sweeps(path, 10_000)
    return path


@pytest.mark.parametrize(
    ("command", "says", "status"),
    [
        (("noctule-mapper", "fit", "many.jsonl"), "sweeps", 130),
        (("noctule-mapper", "export", "many.jsonl", "room.dxf"), "sweeps", 130),
        (("noctule-mapper", "survey", "many.jsonl", "--site", "attic.toml"), "sweeps", 130),
        (REPRODUCE, "simulating and mapping surveys", 130),
        (("noctule", "replay", "many.jsonl", "--site", "attic", "--listen", "ENDPOINT"), "publishing sweeps", 0),
    ],
    ids=["fit", "export", "survey", "reproduce", "replay"],
)
def test_it_shows_how_far_it_is_and_ends_by_ctrl_c(
    tmp_path: Path, many: Path, command: tuple[str, ...], says: str, status: int
) -> None:
    shutil.copy(many, tmp_path)
    (tmp_path / "attic.toml").write_text(SITE)
    listens_at = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    running = OnTerminal(tmp_path, *(listens_at if word == "ENDPOINT" else word for word in command))
    try:
        wait_until(lambda: says in running.shown(), f"a line that says {says!r}", every_s=0.02)
        assert running.process.poll() is None, running.shown()
        assert running.status_by_ctrl_c() == status, running.shown()
        assert "Traceback" not in running.shown()
    finally:
        running.close()


def test_a_backup_that_was_stopped_leaves_nothing_and_can_be_begun_again(tmp_path: Path) -> None:
    data, copy = tmp_path / "data", tmp_path / "copy"
    data.mkdir()
    with closing(sqlite3.connect(data / "u0.sqlite")) as database, database:
        database.execute("CREATE TABLE some (thing)")
    for number in range(1, 5000):  # a second's copying is some hundred of them
        shutil.copy(data / "u0.sqlite", data / f"u{number}.sqlite")
    running = OnTerminal(tmp_path, "noctule-gateway", "backup", str(data), str(copy))
    try:
        wait_until(lambda: "Copying u" in running.shown(), "a line that says what is copied")
        assert running.status_by_ctrl_c() == 130, running.shown()
        assert "Traceback" not in running.shown()
        assert not copy.exists()
    finally:
        running.close()


def test_reproduce_ends_its_processes_when_only_it_is_told_to_end(tmp_path: Path) -> None:
    running = OnTerminal(tmp_path, *REPRODUCE)
    try:
        # The tracker of resources and two that work.
        wait_until(lambda: len(psutil.Process(running.process.pid).children()) >= 3, "its processes")
        assert running.status_by_ctrl_c(group=False) == 130, running.shown()
        wait_until(lambda: not _group_lives(running.process.pid), "the end of its processes")
    finally:
        running.close()


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Where the site attic is found; its one unit has two sweeps and rests."""
    folder = tmp_path_factory.mktemp("attic")
    many_sweeps(folder / "few.jsonl", 2)
    found_at = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    site = OnTerminal(folder, "noctule", "replay", "few.jsonl", "--site", "attic", "--listen", found_at)
    try:
        wait_until(lambda: "has been published" in site.shown(), "the site")
        yield found_at
    finally:
        site.close()


def test_the_units_of_a_site_are_shown_each_second_those_in_trouble_first_until_ctrl_c(
    tmp_path: Path, endpoint: str
) -> None:
    replayed = SITE.partition("\n")[2].replace("zz", paper_survey()[0].unit).replace("99", "1").replace("USB0", "USB1")
    (tmp_path / "attic.toml").write_text(SITE + replayed)
    shown = OnTerminal(tmp_path, "noctule", "units", "attic.toml", "--watch", "--connect", endpoint)
    try:
        wait_until(lambda: shown.shown().count("idle") >= 3, "the unit, three times")
        assert 0 < shown.shown().find("zz") < shown.shown().find("idle")
        assert shown.status_by_ctrl_c() == 0, shown.shown()
    finally:
        shown.close()


def test_record_shows_how_many_sweeps_it_has_and_holds_them_after_ctrl_c(tmp_path: Path, endpoint: str) -> None:
    recording = OnTerminal(tmp_path, "noctule", "record", "attic", "two.jsonl", "--connect", endpoint)
    try:
        wait_until(lambda: re.search(r"sweeps since the start.* 2 ", recording.shown()), "the line")
        assert recording.status_by_ctrl_c() == 0, recording.shown()
        assert [sweep.log_sequence for sweep in survey.read(tmp_path / "two.jsonl")] == [1, 2]
    finally:
        recording.close()


def test_in_a_pipe_it_says_nothing_of_it(tmp_path: Path) -> None:
    many_sweeps(tmp_path / "many.jsonl", 300)
    command = [BIN / "noctule-mapper", "fit", "many.jsonl"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert [line for line in done.stderr.splitlines() if not line.startswith("left out 256 sweeps")] == []
    assert "wall" in done.stdout and "\x1b" not in done.stdout


def _group_lives(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True
