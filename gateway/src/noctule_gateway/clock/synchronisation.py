"""Whether a time server keeps the host's clock right. A sweep does not say: its error is against that clock."""

import logging
from collections.abc import Callable

from noctule.kernel_clock import KernelClock

_log = logging.getLogger(__name__)


class Synchronisation:
    """What the kernel says of its clock, as of the last look(): ``detail`` for the operator, empty when all is well."""

    def __init__(self, kernel_clock: Callable[[], KernelClock]) -> None:
        self.detail = ""
        self.counters: dict[str, int] = {}
        self._kernel_clock = kernel_clock

    def look(self) -> None:
        """Ask the kernel."""
        try:
            clock = self._kernel_clock()
        except OSError:
            self.counters, self.detail = {}, ""  # nothing, where a kernel does not tell
            return
        self.counters = {
            "clock_unsynchronised": int(not clock.synchronised),
            "clock_error_ms": round(clock.most_error_s * 1e3),
        }
        detail = f"the host's clock: {clock.fault}" if clock.fault else ""
        if bool(detail) != bool(self.detail):
            (_log.warning if detail else _log.info)("%s", detail or "the host's clock is synchronised")
        self.detail = detail
