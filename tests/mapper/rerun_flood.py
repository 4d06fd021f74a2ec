"""A process that draws far more than a relay can take; the test beside it watches its memory.

    python rerun_flood.py URL SECONDS RATE_PER_S

It prints ``connected``, waits for a line on its input, then draws images and counts them for SECONDS. It prints its
link's counters and by how many bytes its memory grew at most, and lives on until its input is closed.
"""

import json
import sys
from threading import Event
from time import monotonic

import numpy as np
import psutil
import rerun as rr

from noctule_mapper.rerun_view.drawing import Drawing, Entries
from noctule_mapper.rerun_view.link import RerunLink

TILE_PX = 500  # square, in three colours: 750 kB of noise, which no compression makes smaller


def draw_noise(seed: int) -> Entries:
    yield "noise", rr.Image(np.random.default_rng(seed).integers(0, 255, (TILE_PX, TILE_PX, 3), np.uint8))


def draw_number(number: int) -> Entries:
    yield "number", rr.TextDocument(str(number))


def main(url: str, duration_s: float, rate_per_s: float) -> None:
    line, pause = RerunLink(url, "paper-room", lambda: []), Event()
    line.put(Drawing(draw_noise, (0,), time_s=0.0, sweep=0))
    while line.counters()["rerun_drawn"] == 0:
        pause.wait(0.05)
    print("connected", flush=True)
    sys.stdin.readline()
    process = psutil.Process()
    resident_bytes = most_bytes = process.memory_info().rss
    end_s, number = monotonic() + duration_s, 0
    while monotonic() < end_s:
        number += 1
        line.put(Drawing(draw_noise, (number,), time_s=float(number), sweep=number, subject=f"noise {number % 50}"))
        line.put(Drawing(draw_number, (number,), time_s=float(number), sweep=number, subject="number"))
        most_bytes = max(most_bytes, process.memory_info().rss)
        pause.wait(1.0 / rate_per_s)
    print(json.dumps(line.counters() | {"grew_bytes": most_bytes - resident_bytes, "last": number}), flush=True)
    sys.stdin.read()
    line.close()


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]))
