"""Has the kernel notice that the far end of a TCP line is gone though it never closed: power lost, cable pulled."""

import socket

IDLE_S = 5
PROBE_EVERY_S = 5
PROBES = 3
UNACKNOWLEDGED_MS = 20_000  # the same 20 s where something written awaits its acknowledgement


def watch_far_end(line: socket.socket) -> None:
    """Have ``line`` fail with ETIMEDOUT once its far end has acknowledged nothing, not even probes, in 20 s."""
    line.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, IDLE_S)
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, PROBE_EVERY_S)
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, PROBES)
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNACKNOWLEDGED_MS)
