"""How a command of Noctule starts: while its modules are loaded, Ctrl-C ends it at once and without a traceback."""

import signal
from importlib import import_module
from typing import NoReturn


def start(module: str, function: str) -> NoReturn:
    """Run a command: load ``function`` of ``module``, call it, and end the process with its status.

    The script that calls this should import nothing else first: until this runs, Ctrl-C prints a traceback.
    """
    handler = signal.getsignal(signal.SIGINT)
    if handler is signal.default_int_handler:  # else the program that started us has Ctrl-C ignored
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from noctule.ending import end_with

    program = getattr(import_module(module), function)
    signal.signal(signal.SIGINT, handler)
    end_with(program)
