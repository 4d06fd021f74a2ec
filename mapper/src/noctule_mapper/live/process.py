"""The live mapper as a process: its signals, its log, and how it ends. It never goes on with a part of it dead."""

import logging
import threading
from collections.abc import Callable
from typing import NoReturn

from noctule import logs
from noctule.ending import Ending, leave
from noctule.errors import NoctuleError
from noctule.threads import FAILED, end_process_when_one_fails

_log = logging.getLogger(__name__)


def run_process(
    serve: Callable[[threading.Event], None],
    log_format: logs.LogFormat,
    prefix: str = "",
) -> NoReturn:
    """``serve`` until SIGTERM or SIGINT, then end the process: status 0; 1 for what an operator can put in order;
    70 where a part of the mapper has failed, so that its supervisor starts it again.

    Each line of the log begins with ``prefix``.
    """
    logs.set_up(log_format, prefix)
    end_process_when_one_fails()
    ending = Ending()
    try:
        serve(ending.begun)
        status = 0
    except NoctuleError as error:
        _log.error("%s", error)
        status = 1
    except BaseException:  # Zenoh's PanicException is no Exception
        _log.critical("the mapper has failed; a new start checks its store and goes on from it", exc_info=True)
        status = FAILED
    # All that matters is closed. What Rerun's SDK has registered with atexit would wait without end for a relay that
    # takes nothing.
    leave(status)
