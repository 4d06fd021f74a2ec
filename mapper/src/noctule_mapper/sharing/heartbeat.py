"""Whether a site's mapper still works: it tells the process above what it would tell systemd (sd_notify)."""

import socket
from contextlib import suppress

_LONGEST = 4096  # bytes of a message
# The most of the time between two looks that counts. Where it was longer, this process itself was kept from running, by
# a pause of the whole host or of all its processes, and then nobody is late.
LONGEST_LOOK_S = 1.0


class Heartbeat:
    """Listens to one process at a time at ``address``; begin() when a new one is started. Never waits."""

    def __init__(self) -> None:
        self._receiver = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._receiver.bind("")  # the kernel chooses an abstract address, which begins with a zero byte
        self.address = "@" + self._receiver.getsockname()[1:].decode()
        self.is_ready = False
        self._silent_s = self._looked_at_s = 0.0

    def begin(self, now_s: float) -> None:
        """Forget the process before."""
        self._messages()
        self.is_ready, self._silent_s, self._looked_at_s = False, 0.0, now_s

    def silent_s(self, now_s: float) -> float:
        """For how long the process has made no progress. Until it is ready, to wait for a router is progress too.

        Of the time between two calls LONGEST_LOOK_S counts at most.
        """
        said = {line.partition("=")[0] for message in self._messages() for line in message.splitlines()}
        self.is_ready = self.is_ready or not said.isdisjoint({"READY", "WATCHDOG"})
        progress = "WATCHDOG" in said or (not self.is_ready and "EXTEND_TIMEOUT_USEC" in said)
        self._silent_s = 0.0 if progress else self._silent_s + min(now_s - self._looked_at_s, LONGEST_LOOK_S)
        self._looked_at_s = now_s
        return self._silent_s

    def close(self) -> None:
        """Listen no more."""
        self._receiver.close()

    def _messages(self) -> list[str]:
        messages = []
        with suppress(BlockingIOError):
            while True:
                messages.append(self._receiver.recv(_LONGEST).decode(errors="replace"))
        return messages
