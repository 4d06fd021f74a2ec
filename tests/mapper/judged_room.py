"""A simulated room of one kind, surveyed, mapped and judged; everything in it comes from the room's own seed."""

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from google.protobuf.json_format import MessageToDict, Parse
from mapper.judge import Verdict, judge
from mapper.room import (
    HARD,
    PAPER,
    PLAIN,
    LabelledSweep,
    Physics,
    Room,
    message_of,
    paper_path,
    paper_room,
    random_room,
    survey_labelled,
)

from noctule.messages_pb2 import Sweep
from noctule_mapper.config import MapperConfig
from noctule_mapper.contour.contour import Contour
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.sweep import SweepReadings, from_message

Made = tuple[Room, np.ndarray, Physics]


def paper(rng: np.random.Generator) -> Made:  # noqa: ARG001 -- one room, whatever the seed
    """The paper's room, path and noise."""
    return paper_room(), paper_path(), PAPER


def random(rng: np.random.Generator) -> Made:
    """A random room; the ranges' spread is 1 to 3.2 mm."""
    room, poses = random_room(rng)
    return room, poses, replace(PLAIN, sigma_m=float(rng.uniform(0.001, 0.0032)))


def hard(rng: np.random.Generator) -> Made:
    """A random room with uncertain poses, false, lost and late echoes."""
    return *random_room(rng), HARD


KINDS: dict[str, Callable[[np.random.Generator], Made]] = {"paper": paper, "random": random, "hard": hard}


@dataclass(frozen=True)
class Run:
    """One room: its seed, the verdict, and the processor's time for sweeps and contour."""

    seed: int
    verdict: Verdict
    fit_ms: float
    contour: Contour


def surveyed(kind: str, seed: int, calibrated: bool) -> tuple[Room, list[LabelledSweep], list[SweepReadings]]:
    """A room, its labelled survey, and what the mapper gets of it: read from lines of JSON, at 5 to 35 degrees."""
    rng = np.random.default_rng(seed)
    room, poses, physics = KINDS[kind](rng)
    labelled = survey_labelled(room, poses, rng, physics, calibrated)
    celsius = float(rng.uniform(5, 35))
    lines = [json.dumps(MessageToDict(message_of(one.sweep, celsius))) for one in labelled]
    return room, labelled, [from_message(Parse(line, Sweep())) for line in lines]


def run(seed: int, kind: str, method: str, calibrated: bool) -> Run:
    """Map one room and judge the contour."""
    room, labelled, sweeps = surveyed(kind, seed, calibrated)
    mapper = Mapper(MapperConfig.model_validate({"method": method}))
    began_s = time.process_time()
    for sweep in sweeps:
        mapper.register_sweep(sweep)
    contour = mapper.contour()
    fit_ms = 1000 * (time.process_time() - began_s)
    return Run(seed, judge(contour, room, labelled), fit_ms, contour)
