"""Which program listens on a TCP port of this host, as far as Linux tells this user."""

import errno
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_LISTENS = "0A"  # TCP_LISTEN of the kernel's include/net/tcp_states.h, as proc_net_tcp(5) shows it
_PROC = Path("/proc")


def taken(port: int) -> str:
    """What a program says that wanted to listen there too."""
    return f"port {port} is in use by {holder_of(port)}: stop that, or name another port"


def why_not(error: OSError, port: int) -> str:
    """Why a program can't listen on ``port``, and what to do."""
    if error.errno == errno.EADDRINUSE:
        return taken(port)
    name = "address" if error.errno == errno.EADDRNOTAVAIL else "port"
    return f"{error.strerror or error}: name another {name}"


def holder_of(port: int) -> str:
    """Name and process number, as in ``noctule-gateway (process 41)``; ``another program`` where that is not known."""
    wanted = {f"socket:[{inode}]" for inode in _listening(port)}
    for link in _PROC.glob("[0-9]*/fd/*") if wanted else ():
        with suppress(OSError):  # of another user, or it has just ended
            if str(link.readlink()) in wanted:
                process = link.parents[1]
                return f"{(process / 'comm').read_text().strip()} (process {process.name})"
    return "another program"


def _listening(port: int) -> Iterator[str]:
    """The inodes of the sockets that listen on ``port``."""
    for table in ("tcp", "tcp6"):
        try:
            rows = (_PROC / "net" / table).read_text().splitlines()[1:]
        except OSError:
            continue  # no Linux, or no IPv6
        for fields in map(str.split, rows):
            if fields[3] == _LISTENS and int(fields[1].rsplit(":", 1)[1], 16) == port:
                yield fields[9]
