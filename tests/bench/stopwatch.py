"""Times on the processor, so that what else the machine does matters little."""

import time
from collections.abc import Callable

import numpy as np


def seconds(work: Callable[[], object], least_s: float = 0.2) -> float:
    """Processor time of one ``work``, the median of three rounds of at least ``least_s``; it has run once before."""
    work()
    rounds = []
    for _ in range(3):
        count, began_s = 0, time.process_time()
        while time.process_time() - began_s < least_s:
            work()
            count += 1
        rounds.append((time.process_time() - began_s) / count)
    return float(np.median(rounds))
