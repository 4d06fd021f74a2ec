"""A client that takes no answers holds up nobody else, and what it asks meanwhile has a limit."""

import threading
from collections.abc import Iterator

import pytest

from noctule_gateway.bus import log_readers
from noctule_gateway.bus.log_readers import LogReaders

PATIENCE_S = 20.0


@pytest.fixture
def readers() -> Iterator[LogReaders]:
    readers = LogReaders()
    yield readers
    readers.close()


def test_a_frozen_client_with_many_queries_holds_up_no_other(readers: LogReaders) -> None:
    """A frozen reader held both log readers for 12 s."""
    thaw, answered = threading.Event(), threading.Event()
    frozen = [readers.submit("frozen", lambda: thaw.wait(PATIENCE_S)) for _ in range(10)]
    try:
        assert all(frozen)
        assert readers.submit("healthy", answered.set)
        assert answered.wait(PATIENCE_S / 4)
        assert not thaw.is_set()
    finally:
        thaw.set()


def test_what_floods_is_cut_off_and_named_until_it_has_stopped(readers: LogReaders) -> None:
    thaw, begun, order, last = threading.Event(), threading.Event(), list[int](), threading.Event()

    def first() -> None:
        begun.set()
        thaw.wait(PATIENCE_S)

    assert readers.submit("flood", first)
    assert begun.wait(PATIENCE_S)
    taken = [readers.submit("flood", lambda number=number: order.append(number)) for number in range(1000)]
    assert taken == [True] * log_readers.MAX_WAITING + [False] * (1000 - log_readers.MAX_WAITING)
    assert readers.refused == 936
    assert readers.cut_off() == "queries refused, over 64 of one client wait: flood (936)"
    thaw.set()
    while not readers.submit("flood", last.set):
        pass
    assert last.wait(PATIENCE_S)
    assert order == list(range(log_readers.MAX_WAITING))


def test_clients_without_number_are_refused(readers: LogReaders) -> None:
    thaw = threading.Event()
    taken = [readers.submit(f"c{number}", lambda: thaw.wait(PATIENCE_S)) for number in range(1000)]
    thaw.set()
    assert sum(taken) == log_readers.MAX_CLIENTS


def test_an_answer_that_fails_does_not_end_its_clients_turn(readers: LogReaders) -> None:
    answered = threading.Event()
    readers.submit("one", lambda: 1 // 0)
    readers.submit("one", answered.set)
    assert answered.wait(PATIENCE_S)
