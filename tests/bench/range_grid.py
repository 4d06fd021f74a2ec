"""How many readings a second the reliability grid takes, beside MRPT's occupancy grid: one core, one survey.

Both take the echoes of a walk through the paper's room, again and again, each with the free cone before its arc. MRPT's
grid keeps a byte for each cell and marks the whole arc. Ours keeps counts, 28 bytes for each cell, and sums of PCR6+
where contacts are, so that it can take a reading out again. They run by turns, and a ratio is the median over the
turns: what else the machine does then matters little.
"""

import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from bench.stopwatch import seconds
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.config import GridConfig, MapperConfig
from noctule_mapper.contacts.contact_book import ContactBook
from noctule_mapper.contacts.voting import Contacts
from noctule_mapper.grid.grid import Grid
from noctule_mapper.grid.regions import Cones, contact_regions, free_space
from noctule_mapper.readings.echoes import Echoes, echoes_of
from noctule_mapper.readings.sweep import SweepReadings

CELLS_M = (0.02, 0.05)
TURNS = 5
SOURCE = Path(__file__).with_name("mrpt_range_grid.cpp")
HEADERS = Path("/usr/include/mrpt")
LIBRARIES = ("maps", "obs", "poses", "math", "core", "serialization", "rtti", "system")


@dataclass(frozen=True)
class Walk:
    """A survey, its echoes and what is known of their contacts at its end."""

    sweeps: list[SweepReadings]
    echoes: Echoes
    contacts: Contacts


@dataclass(frozen=True)
class Speed:
    """Readings per second, and the cells that are spoken of after the first round."""

    readings_s: float
    cells: int


def walk(seed: int = 1) -> Walk:
    """The paper's room and path: 572 readings."""
    sweeps = survey(paper_room(), paper_path(), np.random.default_rng(seed))
    config = MapperConfig()
    book = ContactBook(config.contacts)
    for number, sweep in enumerate(sweeps):
        book.add(sweep.identity, sweep.x_m, sweep.y_m, echoes_of(sweep, number, config.noise.assumed_sigma_m))
    return Walk(sweeps, book.echoes(), book.contacts())


def ours(walked: Walk, cell_m: float) -> Speed:
    """The whole survey put in at once, as cones and arcs made beforehand."""
    config = GridConfig(cell_m=cell_m)
    cones = Cones(np.concatenate([free_space(one, config).table for one in walked.sweeps]))
    arcs = contact_regions(walked.echoes, walked.contacts, config)
    grid = Grid(config)

    def put_in() -> None:
        grid.add_free(cones)
        grid.add(arcs)

    put_in()
    spoken_of = sum(int(np.count_nonzero(tile.occupied + tile.free)) for tile in grid.tiles())
    return Speed(len(walked.echoes) / seconds(put_in), spoken_of)


def ours_by_sweep(walked: Walk, cell_m: float) -> Speed:
    """Sweep by sweep from the readings, cones and arcs made on the way."""
    config = GridConfig(cell_m=cell_m)
    grid = Grid(config)
    heard = []
    for number, sweep in enumerate(walked.sweeps):
        own = np.flatnonzero(walked.echoes.sweep == number)
        heard.append((sweep, walked.echoes.take(own), walked.contacts.take(own)))

    def put_in() -> None:
        for sweep, echoes, contacts in heard:
            grid.add_sweep(sweep)
            grid.add_contacts(echoes, contacts)

    put_in()
    spoken_of = sum(int(np.count_nonzero(tile.occupied + tile.free)) for tile in grid.tiles())
    return Speed(len(walked.echoes) / seconds(put_in), spoken_of)


def grid_costs_ms(walked: Walk) -> np.ndarray:
    """What the grid costs each sweep of a live mapper, contacts that move included, (sweeps,)."""
    config = MapperConfig()
    costs_s = []
    for _ in range(10):
        book, grid = ContactBook(config.contacts), Grid(config.grid)
        for number, sweep in enumerate(walked.sweeps):
            echoes = echoes_of(sweep, number, config.noise.assumed_sigma_m)
            change = book.add(sweep.identity, sweep.x_m, sweep.y_m, echoes)
            began_s = time.process_time()
            grid.add_sweep(sweep)
            grid.add_contacts(change.echoes, change.before, sign=-1)
            grid.add_contacts(change.echoes, change.after)
            grid.changed()
            costs_s.append(time.process_time() - began_s)
    return 1e3 * np.array(costs_s)


@contextmanager
def _mrpt_program() -> Iterator[Path | None]:
    """MRPT's program, built for as long as this lasts; None where MRPT isn't installed."""
    if not HEADERS.is_dir():
        yield None
        return
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "mrpt_range_grid"
        headers = [f"-isystem{one}" for one in (*HEADERS.glob("*/include"), "/usr/include/eigen3")]
        libraries = [f"-lmrpt-{name}" for name in LIBRARIES]
        subprocess.run(["g++", "-O2", "-std=c++17", SOURCE, "-o", program, *headers, *libraries], check=True)
        yield program


def _run(program: Path, walked: Walk, cell_m: float) -> Speed:
    echoes = walked.echoes
    lines = np.stack([echoes.x_m, echoes.y_m, echoes.axis_rad, echoes.range_m], axis=1)
    readings = "\n".join(" ".join(map(str, line)) for line in lines)
    width_rad = float(2 * echoes.half_beam_rad[0])
    command = [str(program), str(cell_m), str(width_rad), "0.5"]
    output = subprocess.run(command, input=readings, check=True, capture_output=True, text=True).stdout
    readings_s, cells = output.split()
    return Speed(float(readings_s), int(cells))


def table() -> list[str]:
    """The figures, a line each."""
    walked = walk()
    lines = [f"{len(walked.echoes)} echoes of {13 * len(walked.sweeps)} readings, put in over and over"]
    with _mrpt_program() as program:
        for cell_m in CELLS_M:
            takers = {"survey at once": ours, "sweep by sweep": ours_by_sweep}
            if program:
                takers["MRPT"] = partial(_run, program)
            lines += _by_turns(takers, walked, cell_m)
        if not program:
            lines.append("MRPT isn't installed, so there is no ratio; type: sh deploy/packages.sh bench")
    median_ms, p99_ms = np.percentile(grid_costs_ms(walked), (50, 99))
    lines.append(f"{median_ms:12.2f} ms is the grid's part of a live sweep, 99 of 100 under {p99_ms:.2f} ms")
    return lines


def _by_turns(takers: dict[str, Callable[[Walk, float], Speed]], walked: Walk, cell_m: float) -> list[str]:
    """A line for each of ``takers``, which run by turns."""
    turns = [{what: take(walked, cell_m) for what, take in takers.items()} for _ in range(TURNS)]
    lines = []
    for what in takers:
        middle = Speed(float(np.median([turn[what].readings_s for turn in turns])), turns[0][what].cells)
        line = _line(middle, cell_m, what)
        if what != "MRPT" and "MRPT" in takers:
            ratio = np.median([turn[what].readings_s / turn["MRPT"].readings_s for turn in turns])
            line += f"; {ratio:.2f} of MRPT's"
        lines.append(line)
    return lines


def _line(speed: Speed, cell_m: float, what: str) -> str:
    return f"{speed.readings_s:12,.0f} readings/s at {100 * cell_m:.0f} cm, {what}: {speed.cells:,} cells"
