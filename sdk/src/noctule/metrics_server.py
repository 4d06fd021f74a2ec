"""The address where Prometheus scrapes a service. A flood of scrapes costs the service one rendering a second."""

import logging
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler
from socketserver import TCPServer, ThreadingMixIn
from typing import Any, cast
from urllib.parse import urlsplit

from prometheus_client import CollectorRegistry
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest

from noctule import port_holder
from noctule.errors import NoctuleError

LOOPBACK = "127.0.0.1"
_MOST_AT_ONCE = 8  # connections; one more is closed
_KEPT_S = 1.0  # a status is made each second
_QUIET_S = 5.0  # after which a connection that asks nothing is closed

_log = logging.getLogger(__name__)


class MetricsError(NoctuleError):
    """An address that can't be listened on, or is none."""


def address(text: str) -> tuple[str, int]:
    """Host and port of ``HOST:PORT``, ``[IPv6]:PORT`` or, for loopback, ``PORT``. Raises MetricsError."""
    try:
        where = urlsplit(f"//{LOOPBACK}:{text}" if text.isdecimal() else f"//{text}")
        host, port = where.hostname or LOOPBACK, where.port
    except ValueError:
        port = None
    if port is None:
        raise MetricsError(f"{text!r} is no address for metrics: give HOST:PORT or PORT, as in {LOOPBACK}:9464")
    return host, port


@contextmanager
def serving(where: str | None, registry: CollectorRegistry) -> Iterator[None]:
    """Serve ``registry`` at ``where`` under /metrics; nothing if that is None. Raises MetricsError."""
    if where is None:
        yield
        return
    host, port = address(where)
    try:
        server = _Server(host, port, registry)
    except OSError as error:
        raise MetricsError(f"can't serve metrics at {where}: {port_holder.why_not(error, port)}") from error
    with server:
        threading.Thread(target=server.serve_forever, name="metrics", daemon=True).start()
        shown = f"[{host}]" if ":" in host else host
        _log.info("metrics at http://%s:%d/metrics", shown, server.server_address[1])
        try:
            yield
        finally:
            server.shutdown()


class _Server(ThreadingMixIn, TCPServer):
    # Not http.server's own class: that one looks up the name of the address it listens on, in the DNS.
    allow_reuse_address = True
    daemon_threads = True

    def __init__(self, host: str, port: int, registry: CollectorRegistry) -> None:
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._registry = registry
        self._free = threading.Semaphore(_MOST_AT_ONCE)
        self._rendering = threading.Lock()
        self._page, self._until_s = b"", 0.0
        super().__init__((host, port), _Handler)

    def page(self) -> bytes:
        """The metrics as they are, or were within the last second."""
        with self._rendering:
            if time.monotonic() >= self._until_s:
                self._page = generate_latest(self._registry)
                self._until_s = time.monotonic() + _KEPT_S
            return self._page

    def process_request(self, request: Any, client_address: Any) -> None:
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, _request: Any, _client_address: Any) -> None:
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):  # who asked went away
            _log.exception("a scrape failed")


class _Handler(BaseHTTPRequestHandler):
    timeout = _QUIET_S

    def do_GET(self) -> None:
        if self.path.partition("?")[0] not in ("/", "/metrics"):
            self.send_error(404, "The metrics are at /metrics")
            return
        page = cast(_Server, self.server).page()
        with suppress(OSError):  # who asked went away, or does not read
            self.send_response(200)
            self.send_header("Content-Type", CONTENT_TYPE_LATEST)
            self.send_header("Content-Length", str(len(page)))
            self.end_headers()
            self.wfile.write(page)

    def log_message(self, format: str, *args: object) -> None:
        """Requests are not logged."""
