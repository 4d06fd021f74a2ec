"""Feeds a site's sweeps and contours to InfluxDB 1: to_influxdb.py SITE URL DATABASE [ROUTER ...]

Each once, also after a kill: a point that comes again replaces itself, so all that a restart needs is how far each log
is stored. That is in the database too, written after the readings. A contour that is replaced while this program or
the database is down is not stored.
"""

import json
import logging
import sys
import threading
import urllib.parse
import urllib.request
from collections.abc import Iterator, Sequence

import noctule
from noctule import threads
from noctule.messages_pb2 import Contour, Cursor, Sweep

TIMEOUT_S = 10.0

_log = logging.getLogger("to_influxdb")


class Database:
    """A database of InfluxDB 1, by its HTTP interface."""

    def __init__(self, url: str, name: str, site: str) -> None:
        self._url, self._name, self._site = url.rstrip("/"), name, site
        self._ask("/query", {"q": f'CREATE DATABASE "{name}"'})

    def cursors(self) -> dict[str, Cursor]:
        """How far each unit's log is stored."""
        query = f"SELECT log_sequence, log_id FROM cursor WHERE site = '{self._site}' GROUP BY unit"
        (result,) = json.loads(self._ask("/query", {"q": query, "db": self._name}))["results"]
        return {
            each["tags"]["unit"]: Cursor(unit=each["tags"]["unit"], log_id=log_id, log_sequence=sequence)
            for each in result.get("series", [])
            for _, sequence, log_id in each["values"]
        }

    def store_sweeps(self, sweeps: Sequence[Sweep]) -> None:
        """Some sweeps of one unit, then the cursor: if the first fails, the same sweeps come again."""
        last = sweeps[-1]
        self._write([line for sweep in sweeps for line in reading_lines(sweep)])
        cursor = f"log_id={quoted(last.log_id)},log_sequence={last.log_sequence}i"
        self._write([f"cursor,site={last.site},unit={last.unit} {cursor} 0"])  # always the same point

    def store_contour(self, contour: Contour) -> None:
        """How much a contour holds, unless it is empty. One that can't be written is lost: contours have no log."""
        if not contour.sweeps:
            return
        counts = f"walls={len(contour.walls)}i,corners={len(contour.corners)}i,cylinders={len(contour.cylinders)}i"
        fields = f"{counts},sweeps={contour.sweeps}i,version={contour.version}i"
        line = f"contour,site={contour.site},mapper={contour.mapper} {fields} {contour.time.ToNanoseconds()}"
        try:
            self._write([line])
        except OSError as error:  # urllib's errors and timeouts
            _log.warning("contour %d of %s is not stored: %s", contour.version, contour.mapper, error)

    def _write(self, lines: Sequence[str]) -> None:
        if lines:
            self._ask("/write", {"db": self._name, "precision": "ns"}, "\n".join(lines).encode())

    def _ask(self, path: str, parameters: dict[str, str], body: bytes = b"") -> bytes:
        """The reply to a POST; urllib raises an HTTPError for a refusal."""
        request = urllib.request.Request(f"{self._url}{path}?{urllib.parse.urlencode(parameters)}", body, method="POST")
        with urllib.request.urlopen(request, timeout=TIMEOUT_S) as reply:
            return reply.read()


def reading_lines(sweep: Sweep) -> Iterator[str]:
    """A point for each reading at the time of its ping, without ``time_of_flight_s`` where there was no echo.

    A sweep that does not state its start, as a replayed one may, has no place in a series of times.
    """
    if not sweep.HasField("start"):
        return
    start_ns = sweep.start.ToNanoseconds()
    for reading in sweep.readings:
        fields = f"bearing_rad={reading.bearing_rad},log_id={quoted(sweep.log_id)},log_sequence={sweep.log_sequence}i"
        if reading.HasField("time_of_flight_s"):
            fields += f",time_of_flight_s={reading.time_of_flight_s}"
        yield f"reading,site={sweep.site},unit={sweep.unit} {fields} {start_ns + round(reading.time_offset_s * 1e9)}"


def quoted(text: str) -> str:
    """``text`` as a field of a point."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def main(site: str, url: str, name: str, routers: list[str]) -> None:
    """Store what comes, until the program is ended."""
    with noctule.Client(site, connect=routers) as client:
        database = Database(url, name, site)
        with noctule.LogFollower(client, database.store_sweeps, database.cursors()):
            client.on_contour(database.store_contour)
            threading.Event().wait()


if __name__ == "__main__":
    threads.end_process_when_one_fails()
    try:
        main(sys.argv[1], sys.argv[2], sys.argv[3], sys.argv[4:])
    except OSError as error:
        sys.exit(f"{sys.argv[2]}: {error}")
