"""Whatever a log is asked, it answers with records from there on, or says what it can not read."""

from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from noctule import bounds
from noctule.messages_pb2 import LogGap, LogRecords, Sweep
from noctule_gateway.bus.log_reply import MAX_RECORDS, encoded, read_records
from noctule_gateway.errors import LogError
from noctule_gateway.log.log_file import Arrival, Committed, Retention
from noctule_gateway.log.log_reader import LogSlice
from noctule_gateway.log.rows import Gap
from noctule_gateway.log.sweep_log import SweepLog

SWEEPS = 7
PARAMETERS = st.none() | st.text(max_size=30) | st.integers(-5, 2**70).map(str) | st.integers(0, 10).map(str)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SweepLog]:
    log = SweepLog(Path(tmp_path_factory.mktemp("log")) / "u1.sqlite", Retention())
    for sequence in range(1, SWEEPS + 1):
        done: Future[Committed | LogError] = Future()
        log.append(Arrival(bytes([sequence]), sequence, Sweep(unit="u1", boot=1, sequence=sequence)), done.set_result)
        assert isinstance(done.result(60), Committed)
    yield log
    log.close()


@given(first=PARAMETERS, most=PARAMETERS)
def test_any_parameters_are_a_page_of_the_log_or_refused_in_words(
    log: SweepLog, first: str | None, most: str | None
) -> None:
    try:
        records = bounds.decode(LogRecords, read_records(log, {"from": first, "max": most}.get))
    except ValueError as error:
        assert "is not a count: ask with from=N;max=M" in str(error)
        return
    begin = max(int(first or 1), 1)
    held = range(begin, SWEEPS + 1)[: min(int(most or MAX_RECORDS), MAX_RECORDS)]
    assert [sweep.log_sequence for sweep in records.sweeps] == list(held)
    assert (records.head, records.tail) == (SWEEPS, 1)


def test_a_reply_that_is_put_together_from_records_reads_as_protobuf_would_have_written_it() -> None:
    sweeps = [Sweep(unit="u" * letters) for letters in (0, 125, 126, 127, 16380, 16381, 20000)]
    records = tuple(sweep.SerializeToString() for sweep in sweeps)
    # About 128 and 16384, from which on one more byte is needed to say a length.
    assert [len(record) for record in records] == [0, 127, 128, 129, 16383, 16384, 20004]
    gap = Gap(3, 5, damaged=True, found_elapsed_s=1.0, reason="cut")
    reply = encoded(LogSlice("a", head=12, tail=1, records=records, gaps=(gap,)))
    gaps = [LogGap(first=3, last=5, damaged=True, reason="cut")]
    assert LogRecords.FromString(reply) == LogRecords(log_id="a", head=12, tail=1, sweeps=sweeps, gaps=gaps)
