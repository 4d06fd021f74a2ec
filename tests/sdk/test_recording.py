"""A recording loses nothing that it took, holds nothing twice, and goes on where it ends."""

import pytest

from noctule import survey
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
        with pytest.raises(OSError, match="File too large"):
            recording.append(sweeps(2))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert recording.cursors["u1"].log_sequence == 1
    recording.append(sweeps(2))
    recording.close()
    assert list(survey.read(tmp_path / "survey.jsonl")) == sweeps(1, 2)
