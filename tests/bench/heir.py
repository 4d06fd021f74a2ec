"""How soon a mapper that takes over a site with long logs maps what is measured now, and when it has read all of them.

PYTHONPATH=tests python tests/bench/heir.py --units 20 --logged 2000
"""

import argparse
import contextlib
import os
import sqlite3
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import psutil
from bench.scale.gateway import StreamedUnit, open_units
from system.processes import ROOT, free_ports, listens, programs, repeated, wait_until

from noctule.client import Client

SWEEP_S = 16.0  # from one sweep of a unit to its next one
_WITHIN_S = 3600.0


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--units", type=int, default=20)
    parser.add_argument("--logged", type=int, default=2000, help="sweeps in each unit's log")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, programs(Path(name)) as running, contextlib.ExitStack() as closing:
        folder, endpoint = Path(name), f"tcp/127.0.0.1:{(port := free_ports(1)[0])}"
        environment = os.environ | {"PYTHONPATH": str(ROOT / "tests")}
        running.start("router", sys.executable, "-m", "bench.scale.router", endpoint, env=environment)
        wait_until(lambda: listens(port), "no router")
        units = open_units(folder, "site-0", given.units, endpoint, closing)
        began_ns = time.time_ns()
        for number in range(given.logged, 0, -1):
            for unit in units:
                unit.sweep(began_ns - round(number * SWEEP_S * 1e9))
        wait_until(lambda: all(unit.log.state.head == given.logged for unit in units), "not logged", _WITHIN_S)
        where = ("--site", "site-0", "--data", str(folder / "mapper"), "--connect", endpoint, "--rerun", "none")
        client = closing.enter_context(Client("site-0", connect=[endpoint]))
        closing.enter_context(_reported(units))
        began_s = time.monotonic()
        running.start("mapper", "noctule-mapper", "run", *where)
        store = folder / "mapper" / "site-0.sqlite3"

        def shows_now() -> bool:
            contour = client.contour()
            return contour is not None and contour.time.ToNanoseconds() > began_ns - 2 * SWEEP_S * 1e9

        def tell(condition: Callable[[], bool], what: str) -> None:
            wait_until(condition, what, _WITHIN_S)
            took_s, used_s = time.monotonic() - began_s, _processor_s(running.pid("mapper"))
            print(f"{took_s:10.1f} s ({used_s:.1f} s of a processor in the mapper) until {what}", flush=True)

        tell(lambda: _stored(store) > 0, "a sweep was in the store, from the start of the process")
        for unit in units:
            unit.sweep()
        head = given.logged + 1
        tell(lambda: _newest(store, head) == given.units, "a sweep of now of each unit was in the store")
        tell(shows_now, "a published contour rested on the newest sweeps")
        tell(lambda: _cursors(store) == [head] * given.units, "all logs had been read")


@contextlib.contextmanager
def _reported(units: Sequence[StreamedUnit]) -> Iterator[None]:
    """Each unit's status is published each second, as a gateway does."""

    def report() -> None:
        for unit in units:
            unit.report()

    with repeated(report):
        yield


def _processor_s(pid: int) -> float:
    """Processor time so far of a process and all that it has begun."""
    process = psutil.Process(pid)
    used = [each.cpu_times() for each in (process, *process.children(recursive=True))]
    return sum(each.user + each.system for each in used)


def _stored(store: Path) -> int:
    return _ask(store, "SELECT count(*) FROM sweep")[0] if store.exists() else 0


def _newest(store: Path, head: int) -> int:
    """Units whose sweep ``head`` is held."""
    return _ask(store, f"SELECT count(*) FROM sweep WHERE log_sequence = {head}")[0]


def _cursors(store: Path) -> list[int]:
    return _ask(store, "SELECT log_sequence FROM cursor")


def _ask(store: Path, question: str) -> list[int]:
    with contextlib.closing(sqlite3.connect(f"{store.absolute().as_uri()}?mode=ro", uri=True)) as database:
        try:
            return [number for (number,) in database.execute(question)]
        except sqlite3.OperationalError:  # its tables are not made yet
            return [0]


if __name__ == "__main__":
    main()
