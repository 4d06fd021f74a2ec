"""Whether a site's mapper still works: it tells the process above what it would tell systemd (sd_notify)."""

import socket
from contextlib import suppress

_LONGEST = 4096  # bytes of a message


class Heartbeat:
    """Listens to one process at a time at ``address``; begin() when a new one is started. Never waits."""

    def __init__(self) -> None:
        self._receiver = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._receiver.bind("")  # the kernel chooses an abstract address, which begins with a zero byte
        self.address = "@" + self._receiver.getsockname()[1:].decode()
        self._pinged_at_s: float | None = None

    def begin(self) -> None:
        """Forget the process before."""
        self._messages()
        self._pinged_at_s = None

    def silent_s(self, now_s: float) -> float:
        """How long ago the process last made progress; 0 until it is ready, which takes as long as its router does."""
        if any("WATCHDOG=1" in message.splitlines() for message in self._messages()):
            self._pinged_at_s = now_s
        return 0.0 if self._pinged_at_s is None else now_s - self._pinged_at_s

    def close(self) -> None:
        """Listen no more."""
        self._receiver.close()

    def _messages(self) -> list[str]:
        messages = []
        with suppress(BlockingIOError):
            while True:
                messages.append(self._receiver.recv(_LONGEST).decode(errors="replace"))
        return messages
