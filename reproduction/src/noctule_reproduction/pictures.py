"""Every figure of the paper that a computer can make, drawn, with a caption that says where its data come from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from noctule_reproduction import captions, paper
from noctule_reproduction.calibration_figures import GROUPS, REPEATS, figure_13
from noctule_reproduction.contour_figures import figure_18
from noctule_reproduction.drawing import CORNERS_M
from noctule_reproduction.experiments import ROUNDS, Experiments
from noctule_reproduction.hough_figures import figure_9, figure_11, figure_12
from noctule_reproduction.mass_figures import figure_3, mass_curves
from noctule_reproduction.radius_figures import THRESHOLD_M, TRIES, figure_14, figure_15
from noctule_reproduction.region_figures import figure_5, figure_6, figure_7
from noctule_reproduction.room_figures import figure_17
from noctule_reproduction.style import png

_ANGLES_DEG = (5, 15, 10)  # the paper's two, and one more inside the beam


@dataclass(frozen=True)
class Picture:
    """A figure of the paper by its ``number``, as a PNG image; ``caption`` stands beneath it in the report."""

    number: int
    caption: str
    png: bytes

    @property
    def name(self) -> str:
        """What its file and its entity are called."""
        return f"figure_{self.number:02d}"


def pictures(results: Experiments) -> list[Picture]:
    """All figures, in the paper's order."""
    first, every = f"seed {results.seeds[0]}", seeds_text(results.seeds)
    rounds = f"{first}, the path walked {ROUNDS} times"
    theta, rho_cm = paper.LINES["true"][0]
    on_wall_m = CORNERS_M[0] + np.linspace(0.1, 0.9, 6)[:, None] * (CORNERS_M[1] - CORNERS_M[0])
    curves = [mass_curves(float(np.radians(angle))) for angle in _ANGLES_DEG]
    calibration = {
        "groups": GROUPS,
        "repeats": REPEATS,
        "sigma_range_cm": 100 * results.calibration.spread.sigma_range_m.value,
        "gaussian_p": results.calibration.spread.gaussian_d_p,
    }
    radii = {"tries": TRIES, "threshold_cm": 100 * THRESHOLD_M}
    return [
        _computed(3, lambda note: figure_3(curves, note), every),
        _simulated(5, lambda note: figure_5(results.wall, note), rounds),
        _simulated(6, lambda note: figure_6(results.wall, note), rounds),
        _simulated(7, lambda note: figure_7(results.cylinder, note), rounds),
        _computed(9, lambda note: figure_9(on_wall_m, theta, rho_cm / 100, note), every),
        _simulated(11, lambda note: figure_11(results.accumulator, note), first),
        _simulated(12, lambda note: figure_12(results.hough_points, results.hough_walls, note), first),
        _simulated(13, lambda note: figure_13(results.calibration, note), first, **calibration),
        _simulated(14, lambda note: figure_14(results.reflectors, note), every, **radii),
        _computed(15, figure_15, every),
        _simulated(17, lambda note: figure_17(results.survey, note), first),
        _simulated(18, lambda note: figure_18(results.runs, note), every),
    ]


def seeds_text(seeds: Sequence[int]) -> str:
    """``seeds 1 to 50``; they are consecutive."""
    return f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {seeds[0]} to {seeds[-1]}"


def _simulated(number: int, draw: Callable[[str], Figure], data: str, **values: float) -> Picture:
    figure = draw(f"Simulated, {data}. After Liu et al. 2019, Fig. {number}, which is of a real rig.")
    return Picture(number, captions.simulated(number, data, **values), png(figure))


def _computed(number: int, draw: Callable[[str], Figure], every: str) -> Picture:
    figure = draw(f"Formulae, nothing measured or simulated. After Liu et al. 2019, Fig. {number}.")
    return Picture(number, captions.computed(number, every), png(figure))
