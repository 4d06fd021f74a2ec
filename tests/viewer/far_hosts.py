"""Which hosts are asked for: by processes, as their system calls show, and by a page, as its proxy sees it."""

import re
import socketserver
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from system.processes import wait_until

_SYSTEM_CALLS = "connect,sendto,sendmsg,sendmmsg"
_ADDRESS = re.compile(r'sin6?_port=htons\((\d+)\).*?(?:inet_addr\(|inet_pton\(AF_INET6, )"([^"]+)"')
_RESOLVERS = re.compile(r'sun_path="([^"]*systemd/resolve[^"]*)"')
_LOOPBACK = ("127.", "::1", "::ffff:127.", "0.0.0.0")
_DNS_PORT = 53


def traced(trace: Path) -> list[str]:
    """What to put before a command so that asked() can read ``trace``: the command keeps its process id."""
    return ["strace", "-D", "-f", "-q", "-s", "256", "-e", f"trace={_SYSTEM_CALLS}", "-o", str(trace)]


def asked(trace: Path) -> list[str]:
    """The system calls of a command that has ended that went to another host, or to what resolves names."""
    first = wait_until(trace.read_text, "nothing was traced").split()[0]
    ended = re.compile(rf"^{first} +\+\+\+ (exited|killed)", re.M)
    wait_until(lambda: ended.search(trace.read_text(errors="replace")), "the trace has no end")
    return [line for line in trace.read_text(errors="replace").splitlines() if _goes_out(line)]


def _goes_out(line: str) -> bool:
    address = _ADDRESS.search(line)
    if address is None:
        return _RESOLVERS.search(line) is not None
    port, host = int(address[1]), address[2]
    return port == _DNS_PORT or not host.startswith(_LOOPBACK)


class _Refusing(socketserver.StreamRequestHandler):
    def handle(self) -> None:
        request = self.rfile.readline().decode(errors="replace").strip()
        self.server.requests.append(request)  # pyright: ignore[reportAttributeAccessIssue]
        self.wfile.write(b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")


@contextmanager
def refusing_proxy() -> Iterator[tuple[str, list[str]]]:
    """A proxy that lets nothing through: its address, and the request lines that it has been sent so far."""
    requests: list[str] = []
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), _Refusing) as server:
        server.daemon_threads = True
        server.requests = requests  # pyright: ignore[reportAttributeAccessIssue]
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}", requests
        finally:
            server.shutdown()
