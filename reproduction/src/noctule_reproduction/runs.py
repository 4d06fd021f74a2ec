"""The paper's survey with one seed after another, and what each method makes of it."""

import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import active_children, get_context, resource_tracker
from typing import get_args

import numpy as np

from noctule.progress import Progress
from noctule_mapper.choices import Method
from noctule_mapper.config import MapperConfig
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.contour.contour import Contour
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.sweep import SweepReadings
from noctule_reproduction.specular import paper_path, paper_room, survey_labelled

METHODS: tuple[Method, ...] = get_args(Method)


@dataclass(frozen=True)
class Run:
    """What each method made of the survey of one seed, and how many of its readings have which kind: by tangent circle
    (rows) and by R2d (columns), in the order of ``Kind``.
    """

    seed: int
    contours: dict[Method, Contour]
    contacts: np.ndarray


def paper_survey(seed: int, rounds: int = 1) -> list[SweepReadings]:
    """The paper's path through its room, walked ``rounds`` times, with its noise: sigma 0.32 cm, the mean taken off."""
    poses = np.tile(paper_path(), (rounds, 1))
    return [one.sweep for one in survey_labelled(paper_room(), poses, np.random.default_rng(seed))]


def mapped(sweeps: Sequence[SweepReadings], method: Method) -> Mapper:
    """A mapper that has taken in a survey."""
    mapper = Mapper(MapperConfig(method=method))
    for sweep in sweeps:
        mapper.register_sweep(sweep)
    return mapper


def run(seed: int) -> Run:
    """All methods on the survey of ``seed``."""
    sweeps = paper_survey(seed)
    mappers: dict[Method, Mapper] = {method: mapped(sweeps, method) for method in METHODS}
    report = mappers["eht-lsm"].contact_report()
    contacts = np.zeros((len(Kind), len(Kind)), int)
    np.add.at(contacts, (report.circles.kind, report.r2d.kind), 1)
    return Run(seed, {method: mapper.contour() for method, mapper in mappers.items()}, contacts)


def run_all(seeds: Sequence[int], jobs: int = 1, progress: Progress | None = None) -> list[Run]:
    """A run for each seed, in their order, over ``jobs`` processes, which end with this one's Ctrl-C."""
    progress = progress or Progress()
    runs: list[Run] = []
    progress.at("simulating and mapping surveys", 0, len(seeds))
    for one in map(run, seeds) if jobs == 1 else _spread(seeds, jobs):
        runs.append(one)
        progress.at("simulating and mapping surveys", len(runs), len(seeds))
    return runs


def _spread(seeds: Sequence[int], jobs: int) -> Iterator[Run]:
    resource_tracker.ensure_running()  # which lets Ctrl-C in again when it starts
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        try:
            # The processes inherit that Ctrl-C is held back: it is for this one, which ends them.
            before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            try:
                runs = [pool.submit(run, seed) for seed in seeds]
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
            for each in runs:
                yield each.result()
        except BaseException:
            for process in active_children():
                process.terminate()
            raise
