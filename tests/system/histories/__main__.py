"""Histories by hand, on a deployment in a host of its own (see ``host``; needs root, or user namespaces):

    PYTHONPATH=tests python -m system.histories --seeds 0-24                  # one after another
    PYTHONPATH=tests python -m system.histories --seeds 7 --shrink            # fails? leave out what it does not need
    PYTHONPATH=tests python -m system.histories --faults history.json         # one from a file, as --shrink prints it
    PYTHONPATH=tests python -m system.histories --seeds 0-24 --keep-s 8       # logs that keep 8 s of sweeps
    PYTHONPATH=tests python -m system.histories --seeds 0-999 --hosts 5       # shared out to five hosts, side by side

Twelve histories run in one deployment, one after another, so a later one may fail for what an earlier one has left;
--shrink begins with an empty one each time. Most of a history is waiting: on a quiet machine it takes some 8 s, and 2 s
of a processor. ``--folder`` keeps what the programs have printed. A host stops at its first finding, which later
histories of the deployment would show again. The exit status is 1 if the checker found anything.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

from system.histories import faults, host
from system.histories.deployment import deployment
from system.histories.faults import History
from system.histories.forked import Nursery
from system.histories.play import Outcome, play, settle
from system.histories.shrink import shrink

INSIDE = "--on-own-host"
KEEP_S = 3600.0  # less than the clock is set by
IN_ONE_DEPLOYMENT = 12  # histories: a store that keeps every sweep of one place costs more with each


def main() -> int:
    """Run on a host of its own."""
    options = _options()
    if options.hosts > 1:
        return _shared_out(options)
    if INSIDE not in sys.argv:
        command = host.inside(["system.histories", *sys.argv[1:], INSIDE])
        os.execvp(command[0], command)
    host.set_up()
    with tempfile.TemporaryDirectory() as own:
        folder = options.folder or Path(own)
        folder.mkdir(parents=True, exist_ok=True)
        nursery = Nursery(host.WallClock(folder))
        seeds = _seeds(options.seeds)
        histories = {f"seed {seed}": faults.draw(seed) for seed in seeds}
        if options.faults:
            histories[str(options.faults)] = faults.read_json(options.faults.read_text())
        if options.shrink:
            return max(_shrunk(name, history, folder, nursery, options.keep_s) for name, history in histories.items())
        for first in range(0, len(histories), IN_ONE_DEPLOYMENT):
            place = folder / f"deployment-{first}"
            place.mkdir()
            with deployment(place, nursery, min(seeds, default=0) + first, options.keep_s) as deployed:
                settle(deployed, 0.0)
                for name, history in list(histories.items())[first : first + IN_ONE_DEPLOYMENT]:
                    if _told(name, history, play(deployed, history)):
                        return 1
        return 0


def _shared_out(options: argparse.Namespace) -> int:
    """Play the seeds on several hosts, every n-th on the same; 1 if any of them failed."""
    seeds = _seeds(options.seeds)
    with ExitStack() as running:
        hosts = []
        for number in range(options.hosts):
            share = ",".join(str(seed) for seed in seeds[number :: options.hosts])
            arguments = ["--seeds", share, "--keep-s", str(options.keep_s)]
            arguments += ["--folder", str(options.folder / f"host-{number}")] if options.folder else []
            command = host.inside(["system.histories", *arguments, INSIDE])
            # A host ends with this process, however that ends.
            hosts.append(running.enter_context(subprocess.Popen(["setpriv", "--pdeathsig", "KILL", *command])))
    return int(any(each.returncode != 0 for each in hosts))


def _told(name: str, history: History, outcome: Outcome) -> int:
    """Print how a history went; 1 if it failed."""
    print(
        f"{name}: {len(outcome.findings)} findings in {outcome.took_s:.1f} s, {outcome.handed_over} sweeps so far, "
        f"{outcome.removed} removed unread",
        flush=True,
    )
    if outcome.findings:
        print("\n".join(f"    {each}" for each in (*history, *outcome.findings)), flush=True)
    if outcome.ended:
        print("\n".join(f"    {each}" for each in outcome.ended), flush=True)
    return bool(outcome.findings)


def _shrunk(name: str, history: History, folder: Path, nursery: Nursery, keep_s: float) -> int:
    """Print the smallest part of a history that fails; 1 if it failed at all."""
    tries = 0

    def fails(part: History) -> bool:
        nonlocal tries
        tries += 1
        own = folder / f"{name}-{tries}"
        own.mkdir()
        with deployment(own, nursery, 0, keep_s) as deployed:
            settle(deployed, 0.0)
            return _told(f"{name}, try {tries}", part, play(deployed, part)) == 1

    if not fails(history):
        return 0
    print(faults.to_json(shrink(history, fails)))
    return 1


def _seeds(text: str) -> list[int]:
    """``3,7,10-12`` as numbers."""
    spans = [part.split("-") for part in text.split(",") if part]
    return [seed for span in spans for seed in range(int(span[0]), int(span[-1]) + 1)]


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="system.histories", description=__doc__)
    parser.add_argument("--seeds", default="", help="such as 7 or 0-24 or 3,7")
    parser.add_argument("--faults", type=Path, help="a history as JSON")
    parser.add_argument("--shrink", action="store_true")
    parser.add_argument("--keep-s", type=float, default=KEEP_S, help="how long the gateway's logs keep a sweep")
    parser.add_argument("--hosts", type=int, default=1, help="how many play them side by side")
    parser.add_argument("--folder", type=Path, help="kept when all is over; a temporary one if left out")
    parser.add_argument(INSIDE, action="store_true", help=argparse.SUPPRESS)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
