"""The line's thread: how often it opens what is of no use, and how soon what was."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from math import inf

from noctule_gateway.errors import LineError
from noctule_gateway.line.line import FIRST_RETRY_S, LAST_RETRY_S, OF_USE_S, Line


class Silent:
    """Who speaks on the line, and has nothing to say."""

    next_s = inf

    def __init__(self) -> None:
        self.errors: list[str] = []

    def opened(self, now_s: float) -> None: ...

    def closed(self, error: LineError, now_s: float) -> None:  # noqa: ARG002
        self.errors.append(str(error))

    def receive(self, data: bytes, now_s: float) -> None: ...

    def advance(self, now_s: float) -> None: ...

    def output(self, now_s: float) -> bytes:  # noqa: ARG002
        return b""


@contextmanager
def line_to(server: socket.socket) -> Iterator[Silent]:
    talker = Silent()
    line = Line(f"socket://127.0.0.1:{server.getsockname()[1]}", talker, "u1")
    line.start()
    try:
        yield talker
    finally:
        line.stop()
        line.join()


def accepted_s(server: socket.socket, hold_s: float = 0.0) -> float:
    """Take a connection, send something that is no frame, and hang up after ``hold_s``; when it was taken."""
    connection, _ = server.accept()
    taken_s = time.monotonic()
    with connection:
        connection.sendall(b"Welcome!\r\n")
        threading.Event().wait(hold_s)
    return taken_s


def test_a_server_that_accepts_and_hangs_up_is_opened_ever_later_and_soon_after_it_was_of_use() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(120.0)
        with line_to(server) as talker:
            taken_s = [accepted_s(server) for _ in range(5)]
            waits_s = [after - before for before, after in pairwise(taken_s)]
            assert all(wait_s >= FIRST_RETRY_S * 2**number for number, wait_s in enumerate(waits_s))
            accepted_s(server, hold_s=OF_USE_S + 2.0)
            hung_up_s = time.monotonic()
            accepted_s(server)
            assert time.monotonic() - hung_up_s < LAST_RETRY_S  # which it would be after the six times before
        assert "closed at the other end" in talker.errors[0]
        assert "another program" not in talker.errors[0]  # it has answered


def test_a_server_that_hangs_up_without_a_word_may_serve_another_program() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(30.0)
        with line_to(server) as talker:
            for _ in range(2):
                server.accept()[0].close()
        assert talker.errors[0].endswith(", before a byte had come: does another program have this line?")
