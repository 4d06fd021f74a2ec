"""Keep shell commands running as the demo keeps its parts: kept.py COMMAND ..."""

import os
import signal
import sys
import threading

from supervisor import SUPERVISOR, supervise
from terminal import Terminal


def main() -> None:
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    commands = {f"c{number}": ["sh", "-c", command] for number, command in enumerate(sys.argv[1:])}
    terminal = Terminal([SUPERVISOR, *commands], gone=stop.set)
    supervise(commands, dict(os.environ), stop, terminal.say)
    terminal.close(within_s=1.0)


main()
