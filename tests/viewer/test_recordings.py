"""Recordings by day: what is kept, what a power cut leaves, and that a relay that was started again shows the past."""

import errno
import re
import signal
import subprocess
import tracemalloc
import warnings
from collections.abc import Iterator
from datetime import date, timedelta
from pathlib import Path

import pytest
import rerun as rr
from mapper.rerun_relay import viewer as late_joiner
from rerun.chunk import RrdReader
from system.processes import Programs, programs, wait_until
from viewer.relay_rig import run_viewer, start_relay

from noctule import rerun_paths
from noctule_viewer.recordings import days, rrd_file
from noctule_viewer.recordings.recorder import LEAST_FREE_BYTES, Recorder
from noctule_viewer.recordings.restore import restore
from noctule_viewer.relay import Relay

MONDAY = date(2026, 11, 23)
AMPLE = 10 * LEAST_FREE_BYTES


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Programs]:
    with programs(tmp_path) as made:
        yield made


def record(folder: Path, day: date) -> Path:
    """A recording that begins on ``day``."""
    file = days.next_file(folder, day)
    file.write_bytes(b"RRF2")
    return file


def test_days_are_in_the_order_of_recording_whatever_the_clock_said(tmp_path: Path) -> None:
    for day in (MONDAY, date(1970, 1, 1), MONDAY + timedelta(1), MONDAY + timedelta(1)):
        record(tmp_path, day)
    (tmp_path / "notes.rrd").touch()
    assert [(day.name, len(day.files)) for day in days.days(tmp_path)] == [
        ("2026-11-23", 1),
        ("1970-01-01", 1),
        ("2026-11-24", 2),
    ]
    (tmp_path / "2026-11-25.000005.rrd").touch()
    assert days.newest(tmp_path) == tmp_path / "2026-11-24.000004.rrd"


def test_the_days_that_were_recorded_last_are_kept_whatever_the_clock_says(tmp_path: Path) -> None:
    week = [record(tmp_path, MONDAY + timedelta(number)) for number in range(7)]
    assert days.outdated(tmp_path, 7, "2026-11-29") == []
    assert days.outdated(tmp_path, 7, "2026-11-30") == week[:1]
    # A clock that is wrong for a moment costs a day, and no more.
    assert days.outdated(tmp_path, 7, "2099-01-01") == week[:1]
    week.pop(0).unlink()
    for _ in range(2):
        record(tmp_path, date(2099, 1, 1))
        assert days.outdated(tmp_path, 7, "2099-01-01") == []
    assert days.outdated(tmp_path, 7, "2026-11-29") == []
    assert days.outdated(tmp_path, 1, "2026-11-29")[:-2] == week[:-1]
    assert days.outdated(tmp_path, 20, "2026-11-30") == []


def saved(path: Path, rows: int) -> list[int]:
    """A recording of that many numbers without an index, as of a power cut; its size after each."""
    recording = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id="attic")
    recording.save(path, write_footer=False)
    sizes = []
    for number in range(rows):
        recording.log("number", rr.TextDocument(str(number)))
        recording.flush()
        sizes.append(path.stat().st_size)
    recording.disconnect()
    return sizes


def numbers(path: Path) -> list[str]:
    """The numbers in a recording."""
    with warnings.catch_warnings(action="ignore"):  # it has no index
        reader = RrdReader(path)
    chunks = reader.stream(store=reader.recordings()[0]).to_chunks()
    batches = [chunk.to_record_batch() for chunk in chunks if chunk.entity_path == "/number"]
    return [row[0] for batch in batches for row in batch.column("TextDocument:text").to_pylist()]


def test_a_recording_that_was_cut_off_in_mid_drawing_is_readable_up_to_there(tmp_path: Path) -> None:
    path = tmp_path / "2026-11-23.000001.rrd"
    sizes = saved(path, 10)
    with path.open("r+b") as file:
        file.truncate(sizes[6] + 100)
    with pytest.raises(RuntimeError):
        numbers(path)
    assert rrd_file.cut_incomplete_end(path) == 100
    assert numbers(path) == [str(number) for number in range(7)]
    assert rrd_file.cut_incomplete_end(path) == 0


def test_zeros_that_a_power_cut_has_left_at_the_end_are_no_messages(tmp_path: Path) -> None:
    path = tmp_path / "2026-11-23.000001.rrd"
    size = saved(path, 3)[-1]
    with path.open("ab") as file:
        file.write(bytes(20_000_000))
    tracemalloc.start()
    try:
        assert rrd_file.cut_incomplete_end(path) == 0
        assert len(rrd_file.excerpt(path, 1_000_000)) <= size
        _, most_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most_bytes < 1_000_000  # 118 MB when each 16 zeros were a message
    assert len(numbers(path)) == 3


@pytest.mark.parametrize("contents", [b"", b"RRF2", b"something else"])
def test_a_file_that_is_no_recording_is_left_as_it_is(tmp_path: Path, contents: bytes) -> None:
    path = tmp_path / "2026-11-23.000001.rrd"
    path.write_bytes(contents)
    assert rrd_file.cut_incomplete_end(path) == 0
    assert path.read_bytes() == contents


class Writers:
    """Starts processes that would write, and lets a test end them."""

    def __init__(self) -> None:
        self.started: list[subprocess.Popen[bytes]] = []
        self.files: list[str] = []

    def __call__(self, path: Path) -> subprocess.Popen[bytes]:
        path.touch()
        self.files.append(path.name)
        self.started.append(subprocess.Popen(["sleep", "600"]))
        return self.started[-1]


def test_a_new_day_begins_a_new_file_and_the_days_before_the_last_are_deleted(tmp_path: Path) -> None:
    today, write = [MONDAY], Writers()
    with Recorder(tmp_path, 2, write, today=lambda: today[0], free_bytes=lambda _: AMPLE):
        for number in range(1, 4):
            wait_until(lambda number=number: len(write.started) == number, "no file was begun")
            today[0] += timedelta(1)
        wait_until(lambda: len(write.started) == 4, "no file was begun")
        wait_until(lambda: len(list(tmp_path.iterdir())) == 2, "the days before are still there")
    assert write.files[-1] == "2026-11-26.000004.rrd"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["2026-11-25.000003.rrd", "2026-11-26.000004.rrd"]
    wait_until(lambda: all(writer.poll() is not None for writer in write.started), "a writer goes on")


def test_a_file_that_ends_while_the_viewer_runs_is_readable(tmp_path: Path) -> None:
    write, complete_bytes = Writers(), 0

    def start(path: Path) -> subprocess.Popen[bytes]:
        nonlocal complete_bytes
        complete_bytes = saved(path, 10)[6]
        with path.open("r+b") as file:
            file.truncate(complete_bytes + 100)  # Rerun ends at once when it is asked to
        return write(path)

    with Recorder(tmp_path, 2, start, free_bytes=lambda _: AMPLE):
        wait_until(lambda: write.started, "nothing is written")
    path = tmp_path / write.files[0]
    wait_until(lambda: path.stat().st_size == complete_bytes, "its incomplete end is still there")
    assert numbers(path) == [str(number) for number in range(7)]


def test_the_recording_begins_though_the_past_can_not_be_shown(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> None:
        raise OSError(errno.EAGAIN, "Resource temporarily unavailable")

    write = Writers()
    with Recorder(tmp_path, 2, write, fail, free_bytes=lambda _: AMPLE) as recorder:
        wait_until(lambda: write.started and not recorder.trouble, "nothing is written")
    assert "the hours before are not shown: Resource temporarily unavailable" in caplog.text


def test_a_full_disk_stops_the_recording_and_says_so_until_there_is_room(tmp_path: Path) -> None:
    free, write = [AMPLE], Writers()
    with Recorder(tmp_path, 2, write, free_bytes=lambda _: free[0], pause_s=0.1) as recorder:
        wait_until(lambda: len(write.started) == 1, "nothing is written")
        free[0] = LEAST_FREE_BYTES - 1
        wait_until(lambda: write.started[0].poll() is not None, "it is still written")
        wait_until(lambda: "has 500 MB left" in recorder.trouble, "the full disk is not told")
        free[0] = AMPLE
        wait_until(lambda: len(write.started) == 2 and not recorder.trouble, "nothing is written any more")


def test_on_a_full_disk_a_new_day_makes_room_by_the_oldest(tmp_path: Path) -> None:
    today, write = [MONDAY + timedelta(2)], Writers()
    oldest, newer, newest = (record(tmp_path, MONDAY + timedelta(number)) for number in range(3))

    def free_bytes(_: Path) -> int:
        return LEAST_FREE_BYTES - 1 if oldest.exists() else AMPLE

    with Recorder(tmp_path, 3, write, today=lambda: today[0], free_bytes=free_bytes, pause_s=0.1) as recorder:
        wait_until(lambda: "MB left" in recorder.trouble, "the disk is not full")
        assert oldest.exists()
        today[0] += timedelta(1)
        wait_until(lambda: len(write.started) == 1 and not recorder.trouble, "nothing is recorded on the new day")
    assert write.files == ["2026-11-26.000004.rrd"]
    assert not oldest.exists() and newer.exists() and newest.exists()


def test_a_writer_that_ends_is_logged_and_another_follows(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write = Writers()
    with Recorder(tmp_path, 2, write, free_bytes=lambda _: AMPLE, pause_s=0.1) as recorder:
        wait_until(lambda: len(write.started) == 1, "nothing is written")
        write.started[0].kill()
        wait_until(lambda: "ended by itself, with status -9" in caplog.text, "its end is not logged")
        wait_until(lambda: len(write.started) == 2 and not recorder.trouble, "no other follows")


class Growing(Writers):
    """Writers that write all the time."""

    def __call__(self, path: Path) -> subprocess.Popen[bytes]:
        self.files.append(path.name)
        self.started.append(subprocess.Popen(["sh", "-c", f"while :; do echo >> {path}; sleep 0.05; done"]))
        return self.started[-1]


def test_a_writer_that_hangs_is_told_and_another_follows(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write = Growing()
    with Recorder(tmp_path, 2, write, free_bytes=lambda _: AMPLE, pause_s=0.1, still_after_s=5.0) as recorder:
        wait_until(lambda: write.started and (tmp_path / write.files[0]).exists(), "nothing is written")
        write.started[0].send_signal(signal.SIGSTOP)
        wait_until(lambda: re.search(r"the recorder has written nothing for \d+ s", caplog.text), "it is not told")
        wait_until(lambda: len(write.started) > 1 and not recorder.trouble, "no other follows")
        assert write.started[0].poll() is not None


@pytest.mark.parametrize(("still_after_s", "hangs"), [(60.0, True), (None, False)])
def test_where_nobody_draws_all_the_time_a_writer_may_be_still(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
    still_after_s: float | None,
    hangs: bool,
) -> None:
    looked_at_s: list[float] = []

    def quick_clock() -> float:
        """One on which a minute passes at each look."""
        looked_at_s.append(60.0 * len(looked_at_s))
        return looked_at_s[-1]

    monkeypatch.setattr("noctule_viewer.recordings.recorder.monotonic", quick_clock)
    monkeypatch.setattr("noctule_viewer.recordings.recorder._LOOK_EVERY_S", 0.05)
    write = Writers()
    with Recorder(tmp_path, 2, write, free_bytes=lambda _: AMPLE, pause_s=0.1, still_after_s=still_after_s):
        wait_until(lambda: len(looked_at_s) > 10, "the clock is not looked at")
    assert ("the recorder has written nothing for" in caplog.text) is hangs
    assert (len(write.started) > 1) is hangs


def draw(relay: Relay, first: int, count: int, static: bool = False) -> None:
    """Numbers, and something that never changes."""
    recording = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id="attic")
    recording.connect_grpc(relay.url)
    if static:
        recording.log("frame", rr.TextDocument("the frame"), static=True)
    for number in range(first, first + count):
        recording.log("number", rr.TextDocument(str(number)))
        recording.flush()
    recording.disconnect()


def test_a_relay_that_was_killed_shows_after_its_restart_what_it_has_shown_before(
    running: Programs, tmp_path: Path
) -> None:
    folder, seen = tmp_path / "recordings", tmp_path / "seen"
    seen.mkdir()
    relay = start_relay(running, "--record", str(folder))
    draw(relay, 0, 20, static=True)
    file = wait_until(lambda: days.newest(folder), "nothing is recorded")
    complete = file.with_name("copy.rrd")

    def recorded() -> bool:
        complete.write_bytes(file.read_bytes())
        rrd_file.cut_incomplete_end(complete)
        return complete.stat().st_size > 1000 and len(numbers(complete)) == 20

    wait_until(recorded, "not all was recorded", every_s=0.5)
    running.kill("viewer")
    with file.open("ab") as cut:
        cut.write(b"\2\0\0\0\0\0\0\0\377\377")  # a message that the power cut has cut off
    relay = start_relay(running, "--record", str(folder))
    draw(relay, 20, 1)
    with late_joiner(relay.url, seen) as watching:
        wait_until(
            lambda: sorted(int(text) for (text,) in watching.values("number", "TextDocument:text")) == list(range(21)),
            "the past is not there",
        )
        assert all(chunk.is_static for chunk in watching.wait_for("frame"))
    wait_until(lambda: sum(len(day.files) for day in days.days(folder)) == 2, "the second run records nothing")
    assert "was cut off: 10 bytes" in running.log("viewer")
    running.end("viewer")
    name = days.days(folder)[-1].name
    assert run_viewer("days", str(folder)).stdout.startswith(f"{name}      ")
    assert f"noctule-viewer open {file.name} " in run_viewer("open", str(folder), "--day", name).stdout
    wrong = run_viewer("open", str(folder), "--day", "1999-12-31")
    assert (wrong.returncode, f"it has {name}" in wrong.stderr) == (1, True)


def test_of_a_long_recording_the_newest_comes_back(running: Programs, tmp_path: Path) -> None:
    path, seen = tmp_path / "2026-11-23.000001.rrd", tmp_path / "seen"
    seen.mkdir()
    saved(path, 100)
    relay = start_relay(running)
    restore(relay.url, path, 40_000)
    with late_joiner(relay.url, seen) as watching:

        def shown() -> list[int]:
            return sorted(int(text) for (text,) in watching.values("number", "TextDocument:text"))

        wait_until(lambda: 99 in shown(), "the newest is not there")
        wait_until(lambda: shown() == list(range(shown()[0], 100)), "there are gaps")
        assert 5 < len(shown()) < 50
