"""An MCAP recording gives back its sweeps bit for bit, and one that was cut gives all that lie before the cut."""

import random

import pytest
from mcap.reader import make_reader

from noctule import survey, survey_mcap
from noctule.errors import SurveyError
from noctule.messages_pb2 import Reading, Sweep
from noctule.recording import Recording


def sweeps(count, seed=5):
    """Sweeps of two units with figures of all 53 bits."""
    dice = random.Random(seed)
    made = []
    for number in range(count):
        sweep = Sweep(
            site="room", unit=f"u{number % 2}", log_id="a", log_sequence=number + 1, clock_error_s=dice.random()
        )
        sweep.start.FromNanoseconds(1_700_000_000_000_000_000 + dice.randrange(10**15))
        sweep.readings.extend(
            Reading(bearing_rad=dice.uniform(-3, 3), time_offset_s=dice.random(), time_of_flight_s=dice.random() / 50)
            for _ in range(13)
        )
        made.append(sweep)
    return made


def written(path, held):
    with path.open("wb") as stream:
        survey_mcap.write(held, stream)
    return path.read_bytes()


def test_a_recording_gives_back_what_was_recorded_bit_for_bit(tmp_path):
    path = tmp_path / "survey.mcap"
    recording = Recording(path, "room")
    recorded = sweeps(40)
    recording.append(recorded)
    recording.close()
    came = list(survey.read(path))
    assert [sweep.SerializeToString() for sweep in came] == [sweep.SerializeToString() for sweep in recorded]
    assert written(tmp_path / "again.mcap", came) == path.read_bytes()


def test_a_file_that_was_cut_anywhere_is_read_up_to_the_cut_with_a_warning(tmp_path, caplog):
    """The file's own index says where each sweep ends."""
    path, cut_path = tmp_path / "survey.mcap", tmp_path / "cut.mcap"
    held = sweeps(40)
    whole = written(path, held)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    ends = [index.chunk_start_offset + index.chunk_length for index in summary.chunk_indexes]
    assert len(ends) == 40
    dice = random.Random(1)
    places = [0, 1, 8, *ends, *(end - 1 for end in ends), len(whole) - 1, len(whole) - 9]
    for cut in [*places, *(dice.randrange(len(whole)) for _ in range(300))]:
        caplog.clear()
        cut_path.write_bytes(whole[:cut])
        before = sum(end <= cut for end in ends)
        assert list(survey.read(cut_path)) == held[:before], cut
        assert [record.message for record in caplog.records] == [
            f"{cut_path} is not a whole MCAP file of sweeps: it was cut after sweep {before}; what follows is lost"
        ]


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_a_changed_bit_is_an_error_and_no_cut(tmp_path, share):
    path = tmp_path / "survey.mcap"
    whole = bytearray(written(path, sweeps(40)))
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    index = summary.chunk_indexes[int(40 * share)]
    whole[index.chunk_start_offset + index.chunk_length - 20] ^= 1
    path.write_bytes(bytes(whole))
    with pytest.raises(SurveyError, match="not a whole MCAP file"):
        list(survey.read(path))
