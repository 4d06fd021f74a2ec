"""The paper's survey with one seed after another, and what each method makes of it."""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from typing import get_args

import numpy as np

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


def run_all(seeds: Sequence[int], jobs: int = 1) -> list[Run]:
    """A run for each seed, in their order, over ``jobs`` processes."""
    if jobs == 1:
        return [run(seed) for seed in seeds]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        return list(pool.map(run, seeds, chunksize=max(1, len(seeds) // (4 * jobs))))
