"""How Numba compiles the grid's functions: once after an installation, and the first map waits for it."""

import logging
from functools import partial

from numba import njit
from numba.core import event

_log = logging.getLogger(__name__)

# A division by zero gives inf or NaN as in NumPy: to look for it each time would cost a sixth of a contact region.
compiled = partial(njit, cache=True, error_model="numpy")


def announce() -> None:
    """Log the first compilation of this process; what Numba has kept from an earlier one is loaded without a word."""
    event.register("numba:compile", _Announcing())


class _Announcing(event.Listener):
    def __init__(self) -> None:
        self._told = False

    def on_start(self, event: event.Event) -> None:  # noqa: ARG002
        if not self._told:
            self._told = True
            _log.info("compiling the grid's functions, once after an installation: some 12 s of computing")

    def on_end(self, event: event.Event) -> None:
        pass
