"""What systemd hears of a service: that it is ready, how it fares, that its loop still runs, that it stops (sd_notify).

Nothing here has a thread of its own: such a thread would ping for a service that hangs.
"""

import logging
import os
import socket

SOCKET_VARIABLE = "NOTIFY_SOCKET"
# While a service waits for a router, its start takes as long as the router does. Each call asks for this much more.
_START_EXTENDED_S = 30

_log = logging.getLogger(__name__)


class ServiceManager:
    """Speaks to the service manager that started this process, and to nobody where none did. Never waits.

    A service calls serving() from its own main loop each second, and only while its work makes progress.
    """

    def __init__(self) -> None:
        self._address = os.environ.get(SOCKET_VARIABLE, "")
        self._ready = False

    def waiting(self, status: str) -> None:
        """The start takes longer, for the reason in ``status``."""
        self._send(f"EXTEND_TIMEOUT_USEC={_START_EXTENDED_S * 1_000_000}", _status(status))

    def serving(self, status: str, progress: bool = True) -> None:
        """The service works: READY with the first call, the watchdog's ping with each that makes ``progress``."""
        lines = [_status(status)]
        if not self._ready:
            lines.append("READY=1")
            self._ready = True
        if progress:
            lines.append("WATCHDOG=1")
        self._send(*lines)

    def stopping(self) -> None:
        """The service closes."""
        self._send("STOPPING=1", _status("stopping"))

    def _send(self, *lines: str) -> None:
        if not self._address:
            return
        # An address that begins with @ is in Linux's abstract namespace, which sockets write as a zero byte.
        address = "\0" + self._address[1:] if self._address.startswith("@") else self._address
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
                sender.sendto("\n".join(lines).encode(errors="replace"), socket.MSG_DONTWAIT, address)
        except BlockingIOError:
            pass  # systemd is slow to read; the next second's message says the same
        except OSError as error:
            _log.warning("systemd can't be notified at %s (%s): it is not tried again", self._address, error)
            self._address = ""


def _status(text: str) -> str:
    return f"STATUS={' '.join(text.split())}"
