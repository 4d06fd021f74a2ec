"""How a process of Noctule ends: a service within 5 s of SIGTERM or SIGINT, whatever of it hangs (a router, a disk, a
line, its own log), and every program without the end of the interpreter. NOCTULE_CLOSE_WITHIN_S gives a slow host more.

That end is no place for threads of native code (Zenoh, Rerun). One that wants the interpreter meanwhile is ended by it
inside Rust's frames, and the process aborts ("FATAL: exception not rethrown") or never ends.
"""

import atexit
import contextlib
import faulthandler
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import NoReturn

CLOSE_VARIABLE = "NOCTULE_CLOSE_WITHIN_S"  # names the seconds, where a slow host needs more
_CLOSE_WITHIN_S = 4.0  # for the service to close what it has open
_LOG_WITHIN_S = 0.5  # after that, to say that it did not manage to
_KILLED_AFTER_S = 0.8  # in the same way, by the kernel
NOT_CLOSED = 1  # the exit status then
_STOPPED = 130  # by Ctrl-C
_OUTPUT_LOST = 120  # as Python has it

_log = logging.getLogger(__name__)


def close_within_s() -> float:
    """How long a service may take to close what it has open: 4 s, or what NOCTULE_CLOSE_WITHIN_S says (1 to 600)."""
    text = os.environ.get(CLOSE_VARIABLE)
    if text is None:
        return _CLOSE_WITHIN_S
    with contextlib.suppress(ValueError):
        if 1.0 <= (seconds := float(text)) <= 600.0:
            return seconds
    _log.warning("%s is %r and not a number of seconds from 1 to 600: it is 4 s", CLOSE_VARIABLE, text)
    return _CLOSE_WITHIN_S


class Ending:
    """The end of this process: ``begun`` is set by SIGTERM, SIGINT or begin(), and the process has ended half a second
    after close_within_s() at the latest.

    If it has not ended by itself it is ended with status 1 and nothing is cleaned up, so what a service has said is
    stored must be on the disk at any moment. Make one, in the main thread, when the program starts.
    """

    def __init__(self) -> None:
        self.begun = threading.Event()
        self._lock = threading.Lock()
        self._close_within_s = close_within_s()
        self._nowhere = os.open(os.devnull, os.O_WRONLY)
        woken, wake = os.pipe()
        os.set_blocking(wake, False)
        # A handler in Python runs on the main thread, which may be what hangs. Before that Python's own handler, in C,
        # writes a byte to this pipe, and a thread that does nothing else reads it.
        signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: None)
        threading.Thread(target=self._wait_for_signal, args=(woken,), name="ending", daemon=True).start()

    def begin(self) -> None:
        """Begin to end, without a signal too; the second call does nothing."""
        with self._lock:
            if self.begun.is_set():
                return
            # This clock is a thread in C: it needs no lock of the interpreter, and still runs while that shuts down.
            within_s = self._close_within_s
            faulthandler.dump_traceback_later(within_s + _LOG_WITHIN_S, exit=True, file=self._nowhere)
            signal.setitimer(signal.ITIMER_REAL, within_s + _KILLED_AFTER_S)  # the kernel's SIGALRM, if that fails
            self.begun.set()
        last_resort = threading.Timer(within_s, _give_up, (within_s,))
        last_resort.daemon = True
        last_resort.start()

    def _wait_for_signal(self, woken: int) -> None:
        while os.read(woken, 1)[0] not in (signal.SIGTERM, signal.SIGINT):
            pass
        self.begin()


def end_with(program: Callable[[], object]) -> NoReturn:
    """Run ``program`` and end the process with the status that Python would give it, 130 after Ctrl-C.

    Functions registered with atexit are called. Threads are not waited for, and the interpreter is not shut down, so
    ``program`` has to close what it has opened.
    """
    status = _status_of(program)
    atexit._run_exitfuncs()
    leave(status)


def leave(status: int) -> NoReturn:
    """End this process, when all that matters is closed. What was logged and printed is written out."""
    logging.shutdown()
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and not stream.closed:
            try:
                stream.flush()
            except OSError:
                status = status or _OUTPUT_LOST
    os._exit(status)


def _status_of(program: Callable[[], object]) -> int:
    try:
        program()
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return end.code or 0
        print(end.code, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return _STOPPED
    except BaseException as error:
        if isinstance(error, ImportError) and isinstance(error.__cause__, KeyboardInterrupt):
            return _STOPPED  # a library in C that was being loaded calls Ctrl-C an ImportError
        sys.excepthook(type(error), error, error.__traceback__)
        return 1
    return 0


def _give_up(within_s: float) -> None:
    _log.error("not closed within %g s: ended as it is; nothing stored is lost", within_s)
    os._exit(NOT_CLOSED)
