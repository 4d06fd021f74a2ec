"""How a command of Noctule starts: until its modules are loaded, Ctrl-C ends it at once, and it prints nothing."""

import signal
from importlib import import_module
from typing import NoReturn


def start(module: str, function: str) -> NoReturn:
    """The whole process of a command: load ``function`` of ``module`` and end with its status.

    What loads the program must import no more than this, because Python answers Ctrl-C with a traceback until then.
    """
    handler = signal.getsignal(signal.SIGINT)
    if handler is signal.default_int_handler:  # else whoever started us has Ctrl-C ignored
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from noctule.ending import end_with

    program = getattr(import_module(module), function)
    signal.signal(signal.SIGINT, handler)
    end_with(program)
