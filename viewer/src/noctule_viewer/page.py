"""The page for browsers: Rerun's web viewer, which as Rerun serves it asks four foreign hosts, kept to this machine.

Rerun's own server gives the files. This one, in front of it, forbids the browser to contact any other host.
"""

import json
import logging
import re
import secrets
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler
from importlib.metadata import version
from pathlib import Path
from shutil import copyfileobj
from socketserver import ThreadingTCPServer
from time import time
from typing import Any, cast
from urllib.parse import quote

_log = logging.getLogger(__name__)

_SOURCE_TIMEOUT_S = 10.0
_QUIET_S = 60.0  # after which a connection that asks nothing is closed
ALIVE = "/noctule/alive"
PAGE_MEMORY = "1GB"
"""What of a viewer's memory drawings may take: beyond it the oldest is dropped. The history of a relay with the
default --memory-limit fits in.
"""
_SCRIPT = b"<script>" + Path(__file__).with_name("stale_page.js").read_bytes() + b"</script>"
# Rerun writes twenty thousand lines to the console while it compiles its shaders, which takes seconds of the processor.
_FIRST_SCRIPT = b"<head><script>console.debug = () => {};</script>"
# Rerun's page starts its viewer by the first of these, and ours by the second. Rerun forgets what stands in the address
# as soon as it has read it, so a page that is loaded again would be white; and it drops nothing below 2.5 GB.
_RERUN_STARTS = b"WebHandle(options)"
_OURS_STARTS = (
    b'WebHandle({...options, theme: "dark", hide_welcome_screen: true, memory_limit: "%s",'
    b" on_viewer_event: (json) => window.noctuleEvent(json)})"
) % PAGE_MEMORY.encode()
_RERUN_LOADS = b"wasm_bindgen(res)"
_HEAP_KNOWN = b"wasm_bindgen(res).then((wasm) => (window.noctuleHeap = wasm.memory))"
# A policy does not hold for the connections that a page opens ahead of its requests.
_FOREIGN_LINK = re.compile(rb'<link\b[^>]*"https?://[^>]*>')


@dataclass(frozen=True)
class State:
    """What a page asks for every two seconds: for how long the relay has been silent, 0 while it answers; what is wrong
    at the sites; and when something was last drawn of them, in UTC, None where nobody here draws.
    """

    silent_s: Callable[[], float]
    troubles: Callable[[], Sequence[str]] = tuple
    drawn_s: Callable[[], float | None] = lambda: None


@contextmanager
def serving(address: tuple[str, int], source: tuple[str, int], relay: str, state: State) -> Iterator[None]:
    """Serve at ``address`` what Rerun's server at ``source`` has; the page reads from ``relay``, as ``http://HOST:PORT``,
    and shows ``state``, whatever else it is busy with. Raises OSError if the address can't be had.
    """
    with _Server(address, source, relay, state) as server:
        threading.Thread(target=server.serve_forever, name="page", daemon=True).start()
        try:
            yield
        finally:
            server.shutdown()


def _policy(relay: str) -> str:
    """What the page may load. Loopback at any port, because a tunnel to a remote relay ends at a port of its own."""
    return "; ".join(
        (
            "default-src 'self'",
            "script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'",
            "style-src 'self' 'unsafe-inline'",
            "img-src 'self' data: blob:",
            "worker-src 'self' blob:",
            f"connect-src 'self' data: blob: {relay} http://127.0.0.1:* http://localhost:*",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )


def _ours(html: bytes) -> bytes:
    """Rerun's page with our scripts and without its links to foreign hosts."""
    html = _FOREIGN_LINK.sub(b"", html).replace(_RERUN_STARTS, _OURS_STARTS, 1).replace(_RERUN_LOADS, _HEAP_KNOWN, 1)
    return html.replace(b"<head>", _FIRST_SCRIPT, 1).replace(b"</body>", _SCRIPT + b"</body>")


class _Server(ThreadingTCPServer):
    # Not http.server's own class: that one looks up the name of the address it listens on, in the DNS.
    allow_reuse_address = True
    daemon_threads = True

    def handle_error(self, _request: Any, _client_address: Any) -> None:
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):  # who asked went away
            _log.exception("a part of the page was not sent")

    def __init__(self, address: tuple[str, int], source: tuple[str, int], relay: str, state: State) -> None:
        self.source, self.relay, self.state = source, relay, state
        self.run = secrets.token_hex(8)  # of this program, by which a page knows that it was started again
        super().__init__(address, _Handler)


class _Handler(BaseHTTPRequestHandler):
    timeout = _QUIET_S

    def do_GET(self) -> None:
        server = cast(_Server, self.server)
        if self.path.partition("?")[0] == ALIVE:
            self._tell_alive(server)
            return
        if self.path == "/":
            self._lead_to(server.relay)
            return
        with closing(HTTPConnection(*server.source, timeout=_SOURCE_TIMEOUT_S)) as source:
            try:
                source.request("GET", self.path.partition("?")[0])
                response = source.getresponse()
            except (OSError, HTTPException):
                self.send_error(502, "The relay does not respond")
                return
            kind = response.getheader("Content-Type", "application/octet-stream")
            self.send_response(response.status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Security-Policy", _policy(server.relay))
            length = response.getheader("rerun-final-length")
            if length is not None:  # the page shows its progress by it
                self.send_header("rerun-final-length", length)
            with suppress(ConnectionError):  # the browser went away
                self.end_headers()
                if kind.startswith("text/html"):
                    self.wfile.write(_ours(response.read()))
                else:
                    copyfileobj(response, self.wfile)

    def _lead_to(self, relay: str) -> None:
        """To the page of ``relay``: without an address Rerun's page shows its makers' welcome."""
        self.send_response(302)
        self.send_header("Location", f"/?url={quote(f'rerun+{relay}/proxy', safe='')}")
        self.send_header("Content-Length", "0")
        self.end_headers()

    def _tell_alive(self, server: _Server) -> None:
        told = {
            "run": server.run,
            "silent_s": server.state.silent_s(),
            "troubles": server.state.troubles(),
            "drawn_s": server.state.drawn_s(),
            "now_s": time(),
            "rerun": version("rerun-sdk"),
        }
        content = json.dumps(told).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Length", str(len(content)))
        with suppress(ConnectionError):
            self.end_headers()
            self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:
        """Requests are not logged."""
