"""All that the figures and tables of the report show, computed from the seeds; nothing is drawn here."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule.progress import Progress
from noctule_mapper.calibration.calibrate import Calibration
from noctule_mapper.choices import Method
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.mapper import Mapper
from noctule_mapper.paper.features import FeaturePoints
from noctule_mapper.paper.hough_transform import LineAccumulator, line_accumulator
from noctule_mapper.paper.walls import FittedWall, extended_hough
from noctule_mapper.readings.sweep import SweepReadings
from noctule_reproduction import raster
from noctule_reproduction.calibration_figures import calibrated
from noctule_reproduction.comparison import Comparison, Spread, compare, spread
from noctule_reproduction.radius_figures import RADII_M, TRIES, TestedReflector, tested
from noctule_reproduction.region_figures import Touched, cylinder_readings, wall_readings
from noctule_reproduction.room_figures import Survey
from noctule_reproduction.runs import METHODS, Run, mapped, paper_survey, run_all

ROUNDS = 3  # of the survey that Figures 5-7 show, so that contact regions overlap
_WINDOW_M = (-1.5, -1.3), (2.95, 2.2)
_CALIBRATION, _RADII = 13, 14  # figures whose draws are their own, apart from the surveys'


@dataclass(frozen=True)
class CalibrationSpread:
    """What the calibrations of all seeds found, in centimetres."""

    sigma_d: Spread
    sigma_range: Spread
    mean_d: Spread
    mean_range: Spread


@dataclass(frozen=True)
class Experiments:
    """``survey``, ``wall``, ``cylinder``, ``calibration`` and the Hough transform are of the first seed, the rest of
    all.

    ``hough_points`` are those feature points that lie on walls, ``hough_walls`` the classes that they fall into.
    ``contacts`` counts readings by kind: rows by tangent circle, columns by R2d, in the order of ``Kind``.
    """

    seeds: tuple[int, ...]
    runs: tuple[Run, ...]
    comparisons: dict[Method, Comparison]
    survey: Survey
    wall: Touched
    cylinder: Touched
    hough_points: FeaturePoints
    hough_walls: tuple[FittedWall, ...]
    accumulator: LineAccumulator
    calibration: Calibration
    calibrations: CalibrationSpread
    reflectors: tuple[TestedReflector, ...]
    contacts: np.ndarray


def experiments(seeds: Sequence[int], jobs: int = 1, progress: Progress | None = None) -> Experiments:
    """Everything, from at least one seed, over ``jobs`` processes."""
    progress = progress or Progress()
    runs = run_all(seeds, jobs, progress)
    progress.at("calibrations and figures")
    first = seeds[0]
    sweeps = paper_survey(first)
    mapper = mapped(sweeps, "eht-lsm")
    points = mapper.feature_points()
    walls_points = points.take(points.kind == Kind.WALL)
    config = mapper.config.walls
    longer = paper_survey(first, ROUNDS)
    calibrations = [calibrated(np.random.default_rng((seed, _CALIBRATION))) for seed in seeds]
    return Experiments(
        seeds=tuple(seeds),
        runs=tuple(runs),
        comparisons={method: compare(runs, method) for method in METHODS},
        survey=_survey(sweeps, mapper),
        wall=wall_readings(longer),
        cylinder=cylinder_readings(longer),
        hough_points=walls_points,
        hough_walls=tuple(extended_hough(walls_points, config)),
        accumulator=line_accumulator(walls_points.x_m, walls_points.y_m, config.theta_bin_rad, config.rho_bin_m),
        calibration=calibrations[0],
        calibrations=_calibration_spread(calibrations),
        reflectors=tuple(_reflectors(seeds)),
        contacts=sum((run.contacts for run in runs), np.zeros((len(Kind), len(Kind)), int)),
    )


def _survey(sweeps: Sequence[SweepReadings], mapper: Mapper) -> Survey:
    canvas = raster.blank(*_WINDOW_M, mapper.grid.cell_m)
    tiles = mapper.grid.tiles()
    occupied, free = (raster.tiled(canvas, tiles, name) for name in ("occupied", "free"))
    return Survey(sweeps, occupied, free, mapper.feature_points(), mapper.contour())


def _calibration_spread(calibrations: Sequence[Calibration]) -> CalibrationSpread:
    found = [one.spread for one in calibrations]
    return CalibrationSpread(
        sigma_d=spread([100 * one.sigma_d_m.value for one in found]),
        sigma_range=spread([100 * one.sigma_range_m.value for one in found]),
        mean_d=spread([100 * one.mean_d_m.value for one in found]),
        mean_range=spread([100 * one.mean_error_m.value for one in calibrations if one.mean_error_m]),
    )


def _reflectors(seeds: Sequence[int]) -> list[TestedReflector]:
    """The wall and the four cylinders of Fig. 14, each heard again for every seed."""
    return [
        tested(radius_m, TRIES * len(seeds), np.random.default_rng((*seeds, _RADII, number)))
        for number, radius_m in enumerate((np.inf, *RADII_M))
    ]
