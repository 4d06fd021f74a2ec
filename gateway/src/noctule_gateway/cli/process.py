"""How a process on the bus begins that runs until it is told to end."""

import zenoh

from noctule import logs
from noctule.ending import Ending
from noctule.logs import LogFormat
from noctule.threads import end_process_when_one_fails


def begin(log_format: LogFormat) -> Ending:
    """Write the log, Zenoh's errors in it, end when a thread fails; and what says that SIGTERM or Ctrl-C has come."""
    logs.set_up(log_format)
    zenoh.init_log_from_env_or("error")
    end_process_when_one_fails()
    return Ending()
