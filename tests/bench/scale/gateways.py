"""The gateways of the bench, each a process of its own as in a fleet: ``python -m bench.scale.gateways DATA UNITS
SITES SWEEP_S ROUTER...``.

It prints a line when all are on the bus. It then takes lines from its input: ``burst`` (each unit hands over a full
ring), ``stop`` (no more sweeps; prints each log's head as JSON), until its input ends.

In one process 50 gateways would share one interpreter lock and Zenoh's few threads. The kernel shares a busy machine
out by threads that can run: that one process has one, and 50 mappers have 50.
"""

import json
import multiprocessing
import sys
from contextlib import ExitStack
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from pathlib import Path

from bench.scale import gateway


def main(data: str, units: str, sites: str, sweep_s: str, *routers: str) -> None:
    """Run all gateways until the input ends."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["bench.scale.gateway", __name__])
    with ExitStack() as closing:
        told = [
            _start(context, closing, Path(data), f"site-{n}", count, float(sweep_s), routers[n % len(routers)])
            for n, count in enumerate(_shared_out(int(units), int(sites)))
        ]
        for each in told:
            each.recv()
        print("ready", flush=True)
        for line in sys.stdin:
            word = line.strip()
            for each in told:
                each.send(word)
            if word == "stop":
                print(json.dumps({unit: made for each in told for unit, made in each.recv().items()}), flush=True)


def _shared_out(units: int, sites: int) -> list[int]:
    """How many units each site has."""
    return [units // sites + (number < units % sites) for number in range(sites)]


def _start(
    context: ForkServerContext,
    closing: ExitStack,
    data: Path,
    site: str,
    units: int,
    sweep_s: float,
    router: str,
) -> Connection:
    """The end of a pipe to a new gateway, which ends when the pipe is closed."""
    near, far = context.Pipe()
    process = context.Process(target=gateway.run, args=(far, data, site, units, sweep_s, router), name=site)
    process.start()
    far.close()
    closing.callback(process.join)
    closing.callback(near.close)
    return near


if __name__ == "__main__":
    main(*sys.argv[1:])
