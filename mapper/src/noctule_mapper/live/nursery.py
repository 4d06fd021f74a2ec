"""Forks the process of a map: at the start, and each time that it has ended.

A process that has threads and connections can't be forked safely: the copy would hold its locks and its sockets. So a
mapper forks this one before it has any, but for the threads of OpenBLAS, which it ends itself before a fork. The
nursery shares the memory of all that was loaded by then.

Nothing is left of either when the mapper is killed: the kernel then kills the nursery, and with it the map's process,
even one that is stopped (PR_SET_PDEATHSIG).
"""

import ctypes
import logging
import os
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import NoReturn

from noctule import logs
from noctule.threads import FAILED

_log = logging.getLogger(__name__)
_PR_SET_PDEATHSIG = 1  # of linux/prctl.h
_NUMBER_BYTES = 8


class Nursery:
    """Forks processes that run ``serve``, one at a time. Make it in the main thread, before there is any other.

    Their log, and its own, is as in run_process().
    """

    def __init__(
        self,
        serve: Callable[[Connection], None],
        log_format: logs.LogFormat = logs.LogFormat.TEXT,
        log_prefix: str = "",
    ) -> None:
        self._control, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        own_pid = os.getpid()
        self._pid = os.fork()
        if not self._pid:
            self._control.close()
            _never_return(lambda: _nurse(far, serve, own_pid, log_format, log_prefix))
        far.close()

    def begin(self) -> tuple[Connection, int]:
        """Begin a process: the pipe to it, which ends with it, and its id, which no other has until the next begin().

        Raises RuntimeError where the nursery is gone.
        """
        near, far = socket.socketpair()
        try:
            with _gone_where_closed():
                socket.send_fds(self._control, [b"b"], [far.fileno()])
            pid = self._number()
        except BaseException:
            near.close()
            raise
        finally:
            far.close()
        return Connection(near.detach()), pid

    def ended(self) -> int:
        """Wait for the end of the process that was begun last; its exit code, negative for a signal's number.

        Raises RuntimeError where the nursery is gone.
        """
        return self._number()

    def close(self) -> None:
        """End all of it at once."""
        with suppress(ProcessLookupError):
            os.kill(self._pid, signal.SIGKILL)
        with suppress(ChildProcessError):
            os.waitpid(self._pid, 0)
        self._control.close()

    def _number(self) -> int:
        with _gone_where_closed():
            number = self._control.recv(_NUMBER_BYTES)
            if not number:
                raise ConnectionError
        return int.from_bytes(number, signed=True)


@contextmanager
def _gone_where_closed() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise RuntimeError("the process that the map's is forked from is gone") from error


def _nurse(
    control: socket.socket,
    serve: Callable[[Connection], None],
    mapper_pid: int,
    log_format: logs.LogFormat,
    log_prefix: str,
) -> None:
    _die_with(mapper_pid)
    logs.set_up(log_format, log_prefix)
    # The mapper ends what it has begun. A signal to all processes of a service or a terminal is for the mapper alone.
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)
    own_pid = os.getpid()
    while (handle := _requested(control)) is not None:
        _reap()
        if not (pid := os.fork()):
            control.close()
            _die_with(own_pid)
            _never_return(lambda handle=handle: serve(Connection(handle)))
        os.close(handle)
        try:
            _send(control, pid)
            _send(control, _exit_code(pid))
        except ConnectionError:  # the mapper is gone
            return


def _requested(control: socket.socket) -> int | None:
    """The pipe for the next process; None where the mapper is gone."""
    try:
        message, handles, *_ = socket.recv_fds(control, 1, 1)
    except ConnectionError:
        return None
    return handles[0] if message else None


def _exit_code(pid: int) -> int:
    """Wait for the end of a process, and leave it as a zombie: its pid stays its own."""
    ended = os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
    assert ended is not None
    return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status


def _reap() -> None:
    """Remove the zombie of the last process. No earlier: the mapper may be about to kill a process of its pid."""
    with suppress(ChildProcessError):  # this is the first one
        os.waitpid(-1, os.WNOHANG)


def _send(control: socket.socket, number: int) -> None:
    control.send(number.to_bytes(_NUMBER_BYTES, signed=True))


def _die_with(parent_pid: int) -> None:
    """Have this process killed when its parent ends, which may have happened already."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent_pid:
        os._exit(FAILED)


def _never_return(run: Callable[[], None]) -> NoReturn:
    """End a forked process after ``run``: the code of its parent must not run on in it."""
    status = FAILED
    try:
        run()
        status = 0
    except BaseException:
        _log.critical("a process of the map has failed", exc_info=True)
    finally:
        os._exit(status)
