"""Where the process of a map comes from, and comes from again when it has failed.

A process that has threads and connections can't be forked safely: the copy would hold its locks and its sockets. So a
mapper forks this one before it has any. It shares the memory of all that was loaded by then.

Nothing is left of either when the mapper is killed: the kernel then kills the nursery, and with it the map's process,
even one that is stopped (PR_SET_PDEATHSIG).
"""

import ctypes
import os
import signal
import socket
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import NoReturn

from noctule.threads import FAILED

_PR_SET_PDEATHSIG = 1  # of linux/prctl.h
_NUMBER_BYTES = 8


class Nursery:
    """Forks processes that run ``serve``, one at a time. Make it in the main thread, before there is any other."""

    def __init__(self, serve: Callable[[Connection], None]) -> None:
        self._control, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        own_pid = os.getpid()
        self._pid = os.fork()
        if not self._pid:
            self._control.close()
            _never_return(lambda: _nurse(far, serve, own_pid))
        far.close()

    def begin(self) -> tuple[Connection, int]:
        """Begin a process: the pipe to it, which ends with it, and its id, which is its own until ended().

        Raises RuntimeError where the nursery is gone.
        """
        near, far = socket.socketpair()
        try:
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
        number = self._control.recv(_NUMBER_BYTES)
        if not number:
            raise RuntimeError("the process that the map's is forked from is gone")
        return int.from_bytes(number, signed=True)


def _nurse(control: socket.socket, serve: Callable[[Connection], None], mapper_pid: int) -> None:
    _die_with(mapper_pid)
    # The mapper ends what it has begun. A signal to all processes of a service or a terminal is for the mapper alone.
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)
    own_pid = os.getpid()
    while True:
        _, (handle,), *_ = socket.recv_fds(control, 1, 1)
        if not (pid := os.fork()):
            control.close()
            _die_with(own_pid)
            _never_return(lambda handle=handle: serve(Connection(handle)))
        os.close(handle)
        _send(control, pid)
        _send(control, os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))


def _send(control: socket.socket, number: int) -> None:
    control.send(number.to_bytes(_NUMBER_BYTES, signed=True))


def _die_with(parent_pid: int) -> None:
    """Have this process killed when its parent ends, which may have happened already."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent_pid:
        os._exit(FAILED)


def _never_return(run: Callable[[], None]) -> NoReturn:
    """A fork must not go on with what its parent was at."""
    status = FAILED
    try:
        run()
        status = 0
    finally:
        os._exit(status)
