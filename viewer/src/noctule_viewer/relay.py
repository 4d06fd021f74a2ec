"""The Rerun relay: a process of its own that takes what mappers draw and passes it on to all who watch."""

import os
import socket
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from urllib.parse import quote

import rerun_cli

from noctule import scene
from noctule.errors import NoctuleError
from noctule_viewer.blueprint import blueprint

RERUN = Path(rerun_cli.__file__).with_name("rerun.exe" if sys.platform == "win32" else "rerun")
"""The viewer's own binary: the ``rerun`` on the path is a wrapper that would stand between it and signals."""


class RelayError(NoctuleError):
    """The relay can't be run as asked."""


@dataclass(frozen=True)
class Relay:
    """Where a relay listens. It knows no passwords: whoever reaches it can read and write, so keep it on loopback."""

    bind: str
    port: int
    web_port: int
    memory_limit: str

    @property
    def url(self) -> str:
        """Where mappers and native viewers connect to."""
        return f"rerun+http://{self.bind}:{self.port}/proxy"

    @property
    def page(self) -> str:
        """What to open in a browser."""
        return f"http://{self.bind}:{self.web_port}/?url={quote(self.url, safe='')}&theme=dark"

    def check_ports(self) -> None:
        """Raises RelayError if one of the ports can't be had."""
        for port in (self.port, self.web_port):
            with socket.socket() as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                try:
                    probe.bind((self.bind, port))
                except OSError as error:
                    raise RelayError(
                        f"can't listen on {self.bind}:{port} ({error.strerror}): name another port"
                    ) from error

    def become(self) -> NoReturn:
        """Turn this process into the relay, which reads the layout from its standard input and keeps it for viewers."""
        with tempfile.TemporaryFile() as layout:
            layout.write(_layout())
            layout.seek(0)
            os.dup2(layout.fileno(), sys.stdin.fileno())
        os.environ.setdefault("RUST_LOG", "warn")
        os.execv(RERUN, [str(RERUN), *self._arguments()])

    def _arguments(self) -> list[str]:
        ports = ["--port", str(self.port), "--web-viewer-port", str(self.web_port)]
        return ["--serve-web", "--bind", self.bind, *ports, "--server-memory-limit", self.memory_limit, "-"]


def _layout() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "layout.rbl"
        blueprint().save(scene.APPLICATION_ID, file)
        return file.read_bytes()
