"""Fusion of one cell's beliefs, beside evidencelib's."""

import numpy as np
from bench.stopwatch import seconds
from evidencelib import Frame, MassFunction

from noctule_mapper.fusion import fuse

SOURCES, CELLS = 8, 2000


def table() -> list[str]:
    """PCR6+ of eight sources: microseconds for a cell, and the largest difference."""
    masses = np.random.default_rng(1).dirichlet((1, 1, 1), size=(SOURCES, CELLS))
    mine_s = seconds(lambda: fuse(masses)) / CELLS
    frame = Frame.dst(["O", "F"])
    functions = [MassFunction(frame, {"O": o, "F": f, "O|F": u}, tolerance=1e-6) for o, f, u in masses[:, 0]]
    theirs_s = seconds(lambda: functions[0].pcr6_plus(*functions[1:]))
    fused = functions[0].pcr6_plus(*functions[1:])
    apart = np.abs(fuse(masses[:, 0]) - [fused.mass(key) for key in ("O", "F", "O|F")]).max()
    return [
        f"{1e6 * mine_s:12.1f} us for PCR6+ of {SOURCES} sources in one of {CELLS} cells",
        f"{1e6 * theirs_s:12,.0f} us by evidencelib: ratio {theirs_s / mine_s:,.0f}, {apart:.0e} apart",
    ]
