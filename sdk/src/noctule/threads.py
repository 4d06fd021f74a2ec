"""What happens when a thread of a program fails: the whole program ends, to be started again."""

import logging
import os
import threading

FAILED = 70  # the exit status; EX_SOFTWARE of sysexits.h

_log = logging.getLogger(__name__)


def end_process_when_one_fails() -> None:
    """Log why a thread ended, then end the process with status 70.

    Without the thread the process would look alive and do nothing. A panic of Zenoh (pyo3_runtime.PanicException) ends
    threads too, and must: it leaves locks of the session poisoned, so that every later query panics.
    No clean-up is run: what is durable already is. Call it once, when the program starts.
    """
    threading.excepthook = _end_process


def _end_process(failure: threading.ExceptHookArgs) -> None:
    name = failure.thread.name if failure.thread else "a thread"
    _log.critical("%s failed, and with it the program", name, exc_info=failure.exc_value)
    os._exit(FAILED)
