"""A client that takes no answers holds up nobody else, and what it asks meanwhile has a limit."""

import re
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
import zenoh
from gateway.serving import FIXED, SITE, running, site_file
from system.processes import PATIENCE_S

from noctule import keys
from noctule_gateway.bus import log_readers
from noctule_gateway.bus.held_bytes import MOST_OF_ALL_BYTES, MOST_OF_ONE_BYTES
from noctule_gateway.bus.log_readers import LogReaders
from noctule_gateway.bus.log_reply import MAX_RECORDS


def no_one_is_late() -> None:
    raise AssertionError


@pytest.fixture
def readers() -> Iterator[LogReaders]:
    readers = LogReaders()
    yield readers
    readers.close()


def test_a_frozen_client_with_many_queries_holds_up_no_other(readers: LogReaders) -> None:
    """A frozen reader held both log readers for 12 s."""
    thaw, answered = threading.Event(), threading.Event()
    frozen = [readers.submit("frozen", "u1", lambda _: thaw.wait(PATIENCE_S), no_one_is_late, 0) for _ in range(10)]
    try:
        assert all(frozen)
        assert readers.submit("healthy", "u1", lambda _: answered.set(), no_one_is_late, 0)
        assert answered.wait(PATIENCE_S / 4)
        assert not thaw.is_set()
    finally:
        thaw.set()


def test_what_floods_is_cut_off_and_named_until_it_has_stopped(readers: LogReaders) -> None:
    thaw, begun, order, last = threading.Event(), threading.Event(), list[int](), threading.Event()

    def first(_most: int) -> None:
        begun.set()
        thaw.wait(PATIENCE_S)

    assert readers.submit("flood", "u1", first, no_one_is_late, 0)
    assert begun.wait(PATIENCE_S)
    most = 1 + log_readers.MAX_WAITING  # the unit's first, and these besides
    taken = [
        readers.submit("flood", "u1", lambda _, number=number: order.append(number), no_one_is_late, 0)
        for number in range(1000)
    ]
    assert taken == [True] * most + [False] * (1000 - most)
    assert readers.refused == 935
    assert readers.cut_off() == (
        "queries refused: of flood (935): 65 others of it wait: end it, or have it wait for each answer"
    )
    thaw.set()
    while not readers.submit("flood", "u1", lambda _: last.set(), no_one_is_late, 0):
        pass
    assert last.wait(PATIENCE_S)
    assert order == list(range(most))


def test_queries_that_their_client_has_given_up_are_not_answered_before_those_that_it_waits_for() -> None:
    """A reader asks again after a time-out, and an answer to the question before only delays the next one."""
    thaw, begun, answered, last, clock = threading.Event(), threading.Event(), list[str](), threading.Event(), [0.0]
    readers = LogReaders(now=lambda: clock[0])

    def first(_most: int) -> None:
        begun.set()
        thaw.wait(PATIENCE_S)

    assert readers.submit("reader", "u1", first, no_one_is_late, 0)
    assert begun.wait(PATIENCE_S)
    assert readers.submit("reader", "u1", lambda _: answered.append("given up"), lambda: answered.append("late"), 0)
    clock[0] = log_readers.STALE_AFTER_S
    assert readers.submit("reader", "u1", lambda _: answered.append("awaited"), no_one_is_late, 0)
    assert readers.submit("reader", "u1", lambda _: last.set(), no_one_is_late, 0)
    thaw.set()
    assert last.wait(PATIENCE_S)
    assert answered == ["late", "awaited"]
    readers.close()


def test_a_client_that_still_waits_is_told_to_ask_again_and_not_left_without_a_reply(
    tmp_path: Path, router: zenoh.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(log_readers, "STALE_AFTER_S", 0.0)  # every query has waited too long
    with running(site_file(tmp_path, ("u1", 7, "socket://127.0.0.1:9", FIXED)), tmp_path / "data", router):
        (reply,) = router.get(keys.log(SITE, "u1"), timeout=60.0)
    assert reply.err is not None
    assert "ask again" in reply.err.payload.to_string()


def test_clients_without_number_are_refused(readers: LogReaders) -> None:
    thaw = threading.Event()
    taken = [
        readers.submit(f"c{number}", "u1", lambda _: thaw.wait(PATIENCE_S), no_one_is_late, 0) for number in range(1000)
    ]
    thaw.set()
    assert sum(taken) == log_readers.MAX_CLIENTS


def test_an_answer_that_fails_does_not_end_its_clients_turn(readers: LogReaders) -> None:
    answered = threading.Event()
    readers.submit("one", "u1", lambda _: 1 // 0, no_one_is_late, 0)
    readers.submit("one", "u1", lambda _: answered.set(), no_one_is_late, 0)
    assert answered.wait(PATIENCE_S)


def test_a_client_that_asks_for_much_at_once_leaves_the_gateway_time_for_others(readers: LogReaders) -> None:
    """A client that flooded doubled the latency of every sweep: it kept a thread of Python busy without end. While a
    full answer was made, the sweeps of that moment came 20 ms late.
    """
    takes_s = 0.005
    spans_s, records = list[tuple[float, float]](), list[int]()
    begin, done = threading.Event(), threading.Event()
    asked = log_readers.CROWD + 8

    def answer(most: int) -> None:
        records.append(most)
        begin.wait(PATIENCE_S)
        begun_s = time.monotonic()
        threading.Event().wait(takes_s)
        spans_s.append((begun_s, time.monotonic()))
        if len(spans_s) == asked:
            done.set()

    for _ in range(asked):
        assert readers.submit("flood", "u1", answer, no_one_is_late, 0)
    begin.set()
    assert done.wait(PATIENCE_S)
    rests_s = [following - ended for (_, ended), (following, _) in pairwise(spans_s)]
    # The first answer takes long, for it waits; those of the last CROWD that wait are given one after another.
    assert records[1:] == [log_readers.FEW] * (asked - 1 - log_readers.CROWD) + [MAX_RECORDS] * log_readers.CROWD
    crowded_s = rests_s[1 : asked - log_readers.CROWD]
    assert min(crowded_s) >= log_readers.REST * takes_s
    assert min(rests_s[asked - log_readers.CROWD :]) < log_readers.REST * takes_s


def test_a_reader_of_many_units_that_asks_each_log_once_is_no_crowd(readers: LogReaders) -> None:
    begin, done, records, units = threading.Event(), threading.Event(), list[int](), 4 * log_readers.MAX_WAITING

    def answer(most: int) -> None:
        begin.wait(PATIENCE_S)
        records.append(most)
        if len(records) == units:
            done.set()

    for number in range(units):
        assert readers.submit("reader", f"u{number}", answer, no_one_is_late, 0)
    begin.set()
    assert done.wait(PATIENCE_S)
    assert set(records) == {MAX_RECORDS}
    assert readers.refused == 0


def test_one_long_answer_does_not_keep_a_crowded_client_waiting_long() -> None:
    """Each of the others of that client, which may be clients without a name, would wait many times as long again."""
    clock, long_s = [0.0], 60.0
    begin, late = threading.Event(), threading.Event()
    readers = LogReaders(now=lambda: clock[0])

    def long_answer(_most: int) -> None:
        begin.wait(PATIENCE_S)
        clock[0] += long_s

    try:
        assert readers.submit("", "u1", long_answer, no_one_is_late, 0)
        for _ in range(log_readers.CROWD + 1):
            assert readers.submit("", "u1", lambda _: None, late.set, 0)
        begin.set()
        assert late.wait(long_s)  # many times that without a limit
    finally:
        readers.close()


def test_a_client_that_others_leave_no_room_is_told_so(readers: LogReaders) -> None:
    thaw = threading.Event()

    def wait(_: int) -> None:
        thaw.wait(PATIENCE_S)

    # With what a query takes beside its bytes, the last of these has no room.
    for number in range(MOST_OF_ALL_BYTES // MOST_OF_ONE_BYTES):
        readers.submit(f"o{number}", "u1", wait, no_one_is_late, MOST_OF_ONE_BYTES)
    assert readers.submit("c", "u1", wait, no_one_is_late, 0)
    assert not readers.submit("c", "u2", wait, no_one_is_late, MOST_OF_ONE_BYTES - 2000)
    assert re.fullmatch(
        r"queries refused: of c \(1\): other queries have \d+ of 33554432 bytes that may wait: .*", readers.cut_off()
    )
    thaw.set()
