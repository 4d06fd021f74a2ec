"""The example that feeds InfluxDB, beside a database that keeps points as InfluxDB's write interface defines them.

Measurement, tags and time are a point's identity, and a point that comes again replaces the one that is there (InfluxDB
1.x, "Line protocol" and "Duplicate points"). The example was run with a real InfluxDB 1.6.7 by hand: sdk/README.md.
"""

import importlib.util
import json
import re
import threading
import urllib.error
import urllib.parse
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import ModuleType

import pytest
from system.processes import ROOT

from noctule.messages_pb2 import Contour, Cursor, Reading, Sweep

_POINT = re.compile(r'(?P<identity>\S+) (?P<fields>(?:"(?:\\.|[^"\\])*"|[^ "])+) (?P<time>\d+)')
_STRING = re.compile(r'log_id="((?:\\.|[^"\\])*)"')


class FakeInflux(ThreadingHTTPServer):
    """``points`` by identity and time; a batch beyond ``room`` points is refused whole."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.points: dict[tuple[str, int], str] = {}
        self.room = 1000

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/"

    def write(self, lines: list[str]) -> int:
        if len(self.points) + len(lines) > self.room:
            return 507
        for line in lines:
            point = _POINT.fullmatch(line)
            assert point, line
            self.points[point["identity"], int(point["time"])] = point["fields"]
        return 204

    def cursors(self) -> list[dict]:
        """What InfluxDB 1.6.7 answers to the example's query."""
        series = []
        for (identity, _), fields in self.points.items():
            if identity.startswith("cursor,site=room,unit="):
                log_id = _STRING.search(fields)
                sequence = re.search(r"log_sequence=(\d+)i", fields)
                assert log_id and sequence
                values = [["1970-01-01T00:00:00Z", int(sequence[1]), re.sub(r"\\(.)", r"\1", log_id[1])]]
                tags = {"unit": identity.rpartition("=")[2]}
                series.append({"name": "cursor", "tags": tags, "columns": [], "values": values})
        return [{"statement_id": 0} | ({"series": series} if series else {})]


class _Handler(BaseHTTPRequestHandler):
    server: FakeInflux

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"] or 0)).decode()
        path = urllib.parse.urlsplit(self.path).path
        status = self.server.write(body.splitlines()) if path == "/write" else 200
        self.send_response(status)
        self.end_headers()
        if path == "/query":
            self.wfile.write(json.dumps({"results": self.server.cursors()}).encode())

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture
def influx() -> Iterator[FakeInflux]:
    with FakeInflux() as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


@pytest.fixture(scope="module")
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("to_influxdb", ROOT / "sdk/examples/to_influxdb.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def sweep(number: int, log_id: str = 'a "b" \\') -> Sweep:
    """A sweep with an echo and, 0.1 s later, none."""
    readings = [Reading(bearing_rad=0.5, time_of_flight_s=0.01), Reading(bearing_rad=-0.5, time_offset_s=0.1)]
    made = Sweep(site="room", unit="u1", log_id=log_id, log_sequence=number, readings=readings)
    made.start.FromSeconds(1000 + number)
    return made


def test_readings_are_points_once_each_also_when_they_come_again_after_a_failure(
    influx: FakeInflux, example: ModuleType
) -> None:
    database = example.Database(influx.url, "noctule", "room")
    assert database.cursors() == {}
    influx.room = 4  # no room for the cursor
    with pytest.raises(urllib.error.HTTPError):
        database.store_sweeps([sweep(1), sweep(2)])
    influx.room = 1000
    database.store_sweeps([sweep(1), sweep(2)])
    database.store_sweeps([sweep(3), Sweep(site="room", unit="u1", log_id='a "b" \\', log_sequence=4)])
    readings = {time: fields for (identity, time), fields in influx.points.items() if identity.startswith("reading")}
    assert sorted(readings) == [n * 10**9 + part for n in (1001, 1002, 1003) for part in (0, 10**8)]
    assert readings[1001 * 10**9].endswith("log_sequence=1i,time_of_flight_s=0.01")
    assert "time_of_flight_s" not in readings[1001 * 10**9 + 10**8]
    again = example.Database(influx.url, "noctule", "room")
    assert again.cursors() == {"u1": Cursor(unit="u1", log_id='a "b" \\', log_sequence=4)}


def test_a_contour_is_a_point_and_an_empty_one_is_none(influx: FakeInflux, example: ModuleType) -> None:
    database = example.Database(influx.url, "noctule", "room")
    contour = Contour(site="room", mapper="m", version=3, sweeps=2)
    contour.time.FromSeconds(7)
    for each in (Contour(site="room", mapper="m", version=1), contour, contour):
        database.store_contour(each)
    assert influx.points == {
        ("contour,site=room,mapper=m", 7 * 10**9): "walls=0i,corners=0i,cylinders=0i,sweeps=2i,version=3i"
    }


def test_a_contour_that_the_database_does_not_take_is_one_line_of_log(
    influx: FakeInflux, example: ModuleType, caplog: pytest.LogCaptureFixture
) -> None:
    database = example.Database(influx.url, "noctule", "room")
    influx.room = 0
    database.store_contour(Contour(site="room", mapper="m", version=3, sweeps=2))
    (record,) = caplog.records
    assert record.getMessage().startswith("contour 3 of m is not stored: HTTP Error 507")
    assert record.exc_info is None
