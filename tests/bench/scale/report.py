"""The two scenes of the bench: a fleet whose sites are shared, of which a mapper is killed; and one full gateway."""

import argparse
import tempfile
import time
from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import psutil
import zenoh
from bench.scale.fleet import Fleet, Size, fleet
from bench.scale.gateway import RING_SWEEPS
from system.processes import wait_until

from noctule_mapper.sharing.rendezvous import owner_of

_START_WITHIN_S = 600.0


def main(arguments: Sequence[str]) -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(prog="run.py scale")
    parser.add_argument("--units", type=int, default=1000)
    parser.add_argument("--sites", type=int, default=50)
    parser.add_argument("--sweep-s", type=float, default=16.0, help="from a unit's sweep to its next one")
    parser.add_argument("--seconds", type=float, default=30.0, help="how long each scene is watched")
    parser.add_argument("--one-gateway", type=int, default=64, help="units on the one gateway of the second scene")
    given = parser.parse_args(arguments)
    if given.units:
        _many_sites(Size(given.units, given.sites, routers=2, mappers=3, sweep_s=given.sweep_s), given.seconds)
    if given.one_gateway:
        _one_gateway(Size(given.one_gateway, 1, routers=1, mappers=1, sweep_s=given.sweep_s), given.seconds)


def _many_sites(size: Size, seconds: float) -> None:
    print(
        f"{size.units} units on {size.sites} sites, {size.mappers} mappers, {size.routers} linked routers", flush=True
    )
    with tempfile.TemporaryDirectory() as folder, fleet(size, Path(folder)) as (made, session):
        _say(
            made.wait_for_owners(session, made.names, _START_WITHIN_S),
            "s until every site was mapped, from a cold start",
        )
        _at_cadence(made, seconds)

        def has_contours() -> bool:
            return len(made.times().published_again_s(made.sites, 0.0)) == size.sites

        wait_until(has_contours, "a site has no contour", _START_WITHIN_S)  # which its heir can show
        _nothing_lost(made, *_kill_one(made, session))


def _kill_one(made: Fleet, session: zenoh.Session) -> tuple[set[str], float]:
    """The sites that have moved, and when their mapper was killed (UTC)."""
    killed, began_s = made.names[0], time.time()
    moved = {site for site in made.sites if owner_of(site, made.names) == killed}
    before_s = made.processor_s(but=killed)
    with ThreadPoolExecutor(1) as killing:  # to see the end of all its processes takes a busy machine seconds
        done = killing.submit(made.running.kill, killed)
        took_s = made.wait_for_owners(session, made.names[1:], _START_WITHIN_S)
        used_s = made.processor_s(but=killed) - before_s
        done.result()
    _say(took_s, f"s until the {len(moved)} sites of a killed mapper were mapped")
    # On a machine that does other things too this says more: all that is left, cut in two, is the time of two cores.
    _say(used_s, "s of a processor for all that still ran, in that time")

    def stored_again() -> dict[str, float]:
        return made.times().stored_again_s(moved, began_s)

    wait_until(lambda: stored_again().keys() == moved, "a site of the killed mapper stores nothing", _START_WITHIN_S)
    _say(max(stored_again().values()) - began_s, "s until each of them had stored a sweep")

    def published_again() -> dict[str, float]:
        return made.times().published_again_s(moved, began_s)

    wait_until(lambda: published_again().keys() == moved, "a site of the killed mapper has no contour", _START_WITHIN_S)
    _say(max(published_again().values()) - began_s, "s until each of them had a contour published by its new mapper")
    return moved, began_s


def _one_gateway(size: Size, seconds: float) -> None:
    print(f"{size.units} units on one gateway", flush=True)
    with tempfile.TemporaryDirectory() as folder, fleet(size, Path(folder)) as (made, session):
        made.wait_for_owners(session, made.names, _START_WITHIN_S)
        _at_cadence(made, seconds)
        began_s = time.time()
        made.tell("burst")
        time.sleep(seconds)
        times = made.times()
        # The rings are handed over at one moment, and the sweeps of the cadence follow: the first are the burst.
        burst = np.sort(times.stored_start_s[times.stored_start_s >= began_s])[: size.units * RING_SWEEPS]
        span = (began_s, float(burst[-1]))
        _percentiles(times.to_store_ms(span), f"of {len(burst)} sweeps of a burst of full rings, to the store")
        stored = times.stored_s[(times.stored_start_s >= span[0]) & (times.stored_start_s <= span[1])]
        _say(float(stored.max() - began_s), "s until the whole burst was in the store")
        _nothing_lost(made)


def _at_cadence(made: Fleet, seconds: float) -> None:
    time.sleep(min(10.0, seconds))  # until what has gathered before is done
    before, began_s = made.costs(), time.time()
    time.sleep(seconds)
    after, ended_s = made.costs(), time.time()
    times = made.times()
    settled = time.time() - 5.0  # a sweep of the last seconds may still be on its way to a contour
    units = made.size.units
    for kind, cost in after.items():
        used_ms = 1e3 * (cost.processor_s - before[kind].processor_s) / (ended_s - began_s)
        _say(used_ms / units, f"ms of processor time a second for each unit, {kind}s ({used_ms / 10:.0f} % of a core)")
        _say(cost.memory_mb / units, f"MB for each unit, {kind}s ({cost.memory_mb:.0f} MB)")
    _percentiles(times.to_store_ms((began_s, ended_s)), "from last byte to the mapper's store")
    _percentiles(times.to_log_ms((began_s, ended_s)), "of these from last byte to the gateway's log")
    _percentiles(times.log_to_store_ms((began_s, ended_s)), "of these from the log to the mapper's store")
    _percentiles(times.to_contour_ms((began_s, min(ended_s, settled))), "from last byte to a contour")
    _say(psutil.getloadavg()[0], f"load of the machine, which has {psutil.cpu_count()} cores")


def _nothing_lost(made: Fleet, moved: Collection[str] = (), after_s: float = 0.0) -> None:
    """``moved`` and ``after_s`` as in Times.sequences()."""
    heads = made.stop_sweeps()

    def missing() -> int:
        held = made.times().sequences(moved, after_s)
        return sum(len(set(range(1, head + 1)) - held.get(unit, set())) for unit, head in heads.items())

    with suppress(AssertionError):  # the figure below says what is missing
        wait_until(lambda: missing() == 0, "", within_s=120, every_s=2)
    _say(sum(heads.values()), "sweeps handed over")
    _say(missing(), "of them not in the store of their site's mapper (lost)")
    _say(made.times().doubled(), "taken twice by one mapper (doubled)")


def _percentiles(milliseconds: np.ndarray, what: str) -> None:
    if not len(milliseconds):
        print(f"{'none':>12} {what}", flush=True)
        return
    p50, p99 = np.nanpercentile(milliseconds, (50, 99))  # the gateway may have noted what is read a little later
    print(f"{p50:12.1f} ms p50, {p99:.1f} ms p99 {what} ({len(milliseconds)} sweeps)", flush=True)


def _say(figure: float, what: str) -> None:
    print(f"{figure:12.5g} {what}", flush=True)
