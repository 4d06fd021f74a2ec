"""The far end of the Rerun link in tests: a relay to kill, a viewer that writes down what it is sent, a slow line."""

import os
import signal
import socket
import subprocess
import threading
import warnings
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import rerun.chunk
import rerun_cli
from system.processes import free_ports, listens, wait_until

RERUN = Path(rerun_cli.__file__).with_name("rerun")
ENVIRONMENT = os.environ | {"RUST_LOG": "error"}


class Relay:
    """A relay on a port of its own, up only between start() and kill()."""

    def __init__(self, memory_limit: str = "64MB") -> None:
        (self.port,) = free_ports(1)
        self._memory_limit = memory_limit
        self.url = f"rerun+http://127.0.0.1:{self.port}/proxy"
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        arguments = ["--serve-grpc", "--bind", "127.0.0.1", "--port", str(self.port)]
        self._process = subprocess.Popen(
            [RERUN, *arguments, "--server-memory-limit", self._memory_limit], env=ENVIRONMENT
        )
        process = self._process
        wait_until(lambda: listens(self.port) or process.poll() is not None, "the relay does not listen")
        assert process.poll() is None, "the relay has ended"

    def freeze(self) -> None:
        """Take nothing any more, and leave the line open."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)

    def thaw(self) -> None:
        """Go on after freeze()."""
        assert self._process is not None
        self._process.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


@contextmanager
def relay(memory_limit: str = "64MB") -> Iterator[Relay]:
    """A relay that is not up yet, and surely down at the end."""
    made = Relay(memory_limit)
    try:
        yield made
    finally:
        made.kill()


class Viewer:
    """What a viewer has been sent since it came: chunks by entity path."""

    def __init__(self, file: Path, process: subprocess.Popen[bytes]) -> None:
        self._file, self._process = file, process

    def freeze(self) -> None:
        """Take nothing any more, and leave the line open."""
        self._process.send_signal(signal.SIGSTOP)

    def thaw(self) -> None:
        """Go on after freeze()."""
        self._process.send_signal(signal.SIGCONT)

    def seen(self) -> dict[str, list[rerun.chunk.Chunk]]:
        chunks = defaultdict(list)
        if self._file.exists() and self._file.stat().st_size > 0:
            with (
                warnings.catch_warnings(action="ignore"),
                suppress(RuntimeError, ValueError),
            ):  # a file still in the making
                reader = rerun.chunk.RrdReader(self._file)
                for store in reader.recordings():
                    for chunk in reader.stream(store=store).to_chunks():
                        chunks[chunk.entity_path.strip("/")].append(chunk)
        return chunks

    def recordings(self) -> set[str]:
        """The names of the recordings it has been sent."""
        with warnings.catch_warnings(action="ignore"), suppress(RuntimeError, ValueError):  # as in seen()
            return {store.recording_id for store in rerun.chunk.RrdReader(self._file).recordings()}
        return set()

    def layouts(self) -> list[str]:
        """The applications whose layouts it has been sent."""
        if not self._file.exists() or self._file.stat().st_size == 0:
            return []
        with warnings.catch_warnings(action="ignore"), suppress(RuntimeError, ValueError):  # as in seen()
            return [store.application_id for store in rerun.chunk.RrdReader(self._file).blueprints()]
        return []

    def names_in_layouts(self) -> set[str]:
        """The names of views and tabs in the layouts it has been sent."""
        names: set[str] = set()
        if not self._file.exists() or self._file.stat().st_size == 0:
            return names
        with warnings.catch_warnings(action="ignore"), suppress(RuntimeError, ValueError):  # as in seen()
            reader = rerun.chunk.RrdReader(self._file)
            for store in reader.blueprints():
                for chunk in reader.stream(store=store).to_chunks():
                    batch = chunk.to_record_batch()
                    for column in filter(lambda name: name.endswith("display_name"), batch.schema.names):
                        names.update(name for row in batch.column(column).to_pylist() for name in row)
        return names

    def wait_for(self, path: str, rows: int = 1) -> list[rerun.chunk.Chunk]:
        """The chunks of an entity once it has that many rows."""

        def enough() -> list[rerun.chunk.Chunk]:
            chunks = self.seen()[path]
            return chunks if sum(chunk.num_rows for chunk in chunks) >= rows else []

        return wait_until(enough, f"{path} has not {rows} rows")

    def values(self, path: str, column: str, rows: int = 1) -> list:
        """The values of a column of an entity, row by row, once there are that many."""

        def enough() -> list:
            values = self._values(path, column)
            return values if len(values) >= rows else []

        return wait_until(enough, f"{path} has not {rows} rows of {column}")

    def _values(self, path: str, column: str) -> list:
        batches = [chunk.to_record_batch() for chunk in self.seen()[path]]
        columns = [batch.column(column).to_pylist() for batch in batches if column in batch.schema.names]
        return [value for values in columns for value in values if value is not None]


@contextmanager
def viewer(url: str, folder: Path) -> Iterator[Viewer]:
    """A viewer that comes now."""
    file = folder / f"seen-{len(list(folder.iterdir()))}.rrd"
    process = subprocess.Popen([RERUN, url, "--bind", "127.0.0.1", "--port", "0", "--save", file], env=ENVIRONMENT)
    try:
        yield Viewer(file, process)
    finally:
        process.send_signal(signal.SIGCONT)
        process.terminate()
        process.wait()


class SlowLine:
    """A TCP line to ``target`` that carries no more than ``bytes_per_s`` towards it, until it is widened."""

    def __init__(self, target: int, bytes_per_s: int) -> None:
        self._target = target
        self._bytes_per_s = bytes_per_s
        self._wide = threading.Event()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._sockets = [self._listener]
        threading.Thread(target=self._accept, daemon=True).start()

    def widen(self) -> None:
        """Carry everything as it comes from now on."""
        self._wide.set()

    def close(self) -> None:
        self._wide.set()
        for each in self._sockets:
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                far = socket.create_connection(("127.0.0.1", self._target))
                self._sockets += [near, far]
                threading.Thread(target=self._carry, args=(near, far, self._bytes_per_s), daemon=True).start()
                threading.Thread(target=self._carry, args=(far, near, None), daemon=True).start()

    def _carry(self, source: socket.socket, sink: socket.socket, bytes_per_s: int | None) -> None:
        with suppress(OSError):
            while data := source.recv(4096):
                if bytes_per_s is not None:
                    self._wide.wait(len(data) / bytes_per_s)
                sink.sendall(data)
        with suppress(OSError):
            sink.shutdown(socket.SHUT_WR)
