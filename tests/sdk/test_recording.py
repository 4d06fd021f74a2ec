"""A recording loses nothing that it took, holds nothing twice, and goes on where it ends."""

import os
import random
from contextlib import contextmanager
from pathlib import Path

import pytest

from noctule import survey, survey_mcap
from noctule.errors import SurveyError
from noctule.messages_pb2 import Cursor, Sweep
from noctule.recording import Recording


def sweeps(*sequences, site="room"):
    return [Sweep(site=site, unit="u1", log_id="a", log_sequence=n) for n in sequences]


@pytest.fixture(params=["survey.jsonl", "survey.mcap"])
def path(request, tmp_path):
    return tmp_path / request.param


def test_a_recording_that_was_closed_goes_on_where_it_ends(path):
    first = Recording(path, "room")
    assert first.cursors == {}
    first.append(sweeps(1, 2))
    first.close()
    second = Recording(path, "room")
    assert second.cursors == {"u1": Cursor(unit="u1", log_id="a", log_sequence=2)}
    second.append(sweeps(3))
    second.close()
    assert list(survey.read(path)) == sweeps(1, 2, 3)
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_a_sweep_of_which_a_crash_left_half_is_recorded_again(path):
    first = Recording(path, "room")
    first.append(sweeps(1, 2))
    journal = path.parent / ("survey.mcap.jsonl" if path.suffix == ".mcap" else path.name)
    with journal.open("a") as file:
        file.write(survey.to_json(sweeps(3)[0])[:-20])
    first._file.close()  # as a crash would, with nothing finished
    second = Recording(path, "room")
    assert second.cursors["u1"].log_sequence == 2
    second.append(sweeps(3))
    second.close()
    assert list(survey.read(path)) == sweeps(1, 2, 3)


def test_a_last_line_without_its_end_is_kept_if_it_is_whole(tmp_path):
    path = tmp_path / "survey.jsonl"
    path.write_text("\n" + survey.to_json(sweeps(1)[0]))
    recording = Recording(path, "room")
    recording.append(sweeps(2))
    recording.close()
    assert list(survey.read(path)) == sweeps(1, 2)


def test_another_sites_sweeps_in_the_file_say_nothing_of_this_site(tmp_path):
    path = tmp_path / "survey.jsonl"
    with path.open("w") as stream:
        survey.write(sweeps(7, site="hall"), stream)
    recording = Recording(path, "room")
    assert recording.cursors == {}
    recording.close()


@pytest.mark.parametrize("content", ["a letter, not a survey", '{"unit": 3}\n{"unit": "u1"}\n'])
def test_a_file_that_holds_something_else_is_refused_and_left_as_it_was(tmp_path, content):
    path = tmp_path / "survey.jsonl"
    path.write_text(content)
    with pytest.raises(SurveyError, match=r"survey\.jsonl, line 1: not"):
        Recording(path, "room")
    assert path.read_text() == content


def test_two_do_not_record_to_one_file(path):
    first = Recording(path, "room")
    with pytest.raises(SurveyError, match="is being recorded by another process"):
        Recording(path, "room")
    first.close()


def test_a_folder_that_is_not_there_is_told(tmp_path):
    with pytest.raises(SurveyError, match=r"none/survey\.jsonl can't be written: No such file"):
        Recording(tmp_path / "none" / "survey.jsonl", "room")


def test_a_batch_for_which_the_disk_has_no_room_leaves_the_file_as_it_was(tmp_path):
    """RLIMIT_FSIZE makes the kernel refuse the second batch half way, as a full disk does."""
    import resource
    import signal

    recording = Recording(tmp_path / "survey.jsonl", "room")
    recording.append(sweeps(1))
    size = (tmp_path / "survey.jsonl").stat().st_size
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(1.5 * size), before[1]))
    try:
        with pytest.raises(SurveyError, match="File too large: see to its disk"):
            recording.append(sweeps(2))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert recording.cursors["u1"].log_sequence == 1
    recording.append(sweeps(2))
    recording.close()
    assert list(survey.read(tmp_path / "survey.jsonl")) == sweeps(1, 2)


def crash(recording):
    """As a crash would, with nothing finished."""
    recording._file.close()


def write_mcap(path, written):
    with path.open("wb") as stream:
        survey_mcap.write(written, stream)


def recorded(path, site="room"):
    """What is in the file once a recording that goes on there was finished."""
    Recording(path, site).close()
    return list(survey.read(path))


@pytest.mark.parametrize("held", [(), (1, 2), (1, 2, 3, 4, 5), (44, 45, 46)])
def test_a_journal_that_holds_less_than_its_mcap_file_takes_nothing_from_it(tmp_path, held):
    """A power cut can leave an empty journal beside a whole file."""
    path = tmp_path / "survey.mcap"
    write_mcap(path, sweeps(*range(1, 45)))
    with (tmp_path / "survey.mcap.jsonl").open("w") as stream:
        survey.write(sweeps(*held), stream)
    going_on = Recording(path, "room")
    last = max(44, *held, 0)
    assert going_on.cursors["u1"].log_sequence == last
    going_on.append(sweeps(last + 1))
    going_on.close()
    assert list(survey.read(path)) == sweeps(*range(1, last + 2))
    assert [file.name for file in tmp_path.iterdir()] == ["survey.mcap"]


@pytest.mark.parametrize("tail", [b"\0", b"\0" * 4096, b'{"site": "ro', b'{"site": "ro' + b"\0" * 4096])
def test_what_a_power_cut_leaves_of_a_line_is_cut_off_and_told(path, tail, caplog):
    """ext4 and xfs can lengthen a file before its data is there; what was not written reads as NULs."""
    first = Recording(path, "room")
    first.append(sweeps(1, 2))
    crash(first)
    journal = path.parent / ("survey.mcap.jsonl" if path.suffix == ".mcap" else path.name)
    with journal.open("ab") as file:
        file.write(tail)
    second = Recording(path, "room")
    assert f"ended in {len(tail)} bytes of a line that a crash cut off" in caplog.text
    second.append(sweeps(3))
    second.close()
    assert list(survey.read(path)) == sweeps(1, 2, 3)


def test_a_whole_line_before_nuls_is_kept(tmp_path):
    path = tmp_path / "survey.jsonl"
    path.write_text(survey.to_json(sweeps(1)[0]) + "\0\0\0")
    going_on = Recording(path, "room")
    going_on.append(sweeps(2))
    going_on.close()
    assert list(survey.read(path)) == sweeps(1, 2)


@pytest.mark.parametrize("seed", range(3))
def test_an_mcap_file_that_was_cut_anywhere_is_refused_and_left_with_its_journal(tmp_path, seed):
    dice = random.Random(seed)
    path, journal = tmp_path / "survey.mcap", tmp_path / "survey.mcap.jsonl"
    write_mcap(path, sweeps(*range(1, 45)))
    whole = path.read_bytes()
    with journal.open("w") as stream:
        survey.write(sweeps(45), stream)
    for cut in [0, 1, 8, len(whole) - 1, *(dice.randrange(len(whole)) for _ in range(20))]:
        path.write_bytes(whole[:cut])
        before = journal.read_bytes()
        with pytest.raises(SurveyError, match=r"not a whole MCAP file.* move it away, or record to another file"):
            Recording(path, "room")
        assert (path.read_bytes(), journal.read_bytes()) == (whole[:cut], before)


class PowerCut(BaseException):
    """The end of everything, between two steps."""


class Disk:
    """Counts the steps by which files become durable, and cuts the power before one of them.

    At a rename it checks that the file's data was synced: else a power cut could leave an empty file of that name.
    """

    def __init__(self, monkeypatch):
        self.steps_left = 1 << 30
        self.steps = 0
        self._synced: dict[int, int] = {}  # by inode, how much of it
        for owner, step in ((os, "fsync"), (Path, "replace"), (Path, "unlink")):
            monkeypatch.setattr(owner, step, self._counted(step, getattr(owner, step)))

    def _counted(self, name, real):
        def step(*arguments):
            if self.steps_left == 0:
                raise PowerCut
            self.steps_left -= 1
            self.steps += 1
            if name == "replace":
                state = arguments[0].stat()
                assert self._synced.get(state.st_ino) == state.st_size
            result = real(*arguments)
            if name == "fsync":
                state = os.fstat(arguments[0])
                self._synced[state.st_ino] = state.st_size
            return result

        return step

    @contextmanager
    def cut_after(self, steps):
        self.steps_left = steps
        try:
            yield
        except PowerCut:
            pass
        finally:
            self.steps_left = 1 << 30


@pytest.mark.parametrize("seed", range(20))
def test_no_sweep_that_was_once_durable_is_lost_to_power_cuts(tmp_path, monkeypatch, path, seed):
    """Cuts between any two steps of begin, append and finish, each leaving the journal's last line torn at random."""
    dice = random.Random(seed)
    disk = Disk(monkeypatch)
    journal = tmp_path / ("survey.mcap.jsonl" if path.suffix == ".mcap" else path.name)
    durable = 0
    for _ in range(12):
        recording = None
        with disk.cut_after(dice.randrange(12)):
            recording = Recording(path, "room")
            following = recording.cursors["u1"].log_sequence + 1 if recording.cursors else 1
            assert following > durable
            for first in range(following, following + dice.randrange(8), 2):
                recording.append(sweeps(first, first + 1))
                durable = first + 1
            recording.close()
        if recording is not None:
            crash(recording)
        if recording is not None and journal.exists():  # what it was just writing
            with journal.open("ab") as file:
                file.write(dice.choice([b"", survey.to_json(sweeps(10**6)[0]).encode()[: dice.randrange(40)]]))
                file.write(bytes(dice.choice([0, 1, 512])))
    came = [sweep.log_sequence for sweep in recorded(path)]
    assert came == list(range(1, len(came) + 1))
    assert len(came) >= durable > 0


def test_a_power_cut_is_tried_between_all_steps_of_a_finish(tmp_path, monkeypatch):
    disk = Disk(monkeypatch)
    path = tmp_path / "survey.mcap"
    write_mcap(path, sweeps(*range(1, 4)))
    going_on = Recording(path, "room")
    going_on.append(sweeps(4))
    crash(going_on)
    kept = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    finishing = Recording(path, "room")
    before = disk.steps
    finishing.close()
    steps = disk.steps - before
    assert steps == 5  # data, name, folder, the journal's end, folder
    for step in range(steps + 1):
        for file in tmp_path.iterdir():
            file.unlink()
        for name, data in kept.items():
            (tmp_path / name).write_bytes(data)
        going_on = Recording(path, "room")
        with disk.cut_after(step):
            going_on.close()
        crash(going_on)
        assert recorded(path) == sweeps(1, 2, 3, 4)
