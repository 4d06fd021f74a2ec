"""Figure 13: the calibration before a wall, and how d = R2d - R2 spreads."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import norm

from noctule_mapper.calibration.calibrate import Calibration, calibrate
from noctule_mapper.readings.sweep import SweepReadings
from noctule_reproduction import paper
from noctule_reproduction.specular import PAPER_BIAS_M, PAPER_SIGMA_M
from noctule_reproduction.style import FAINT, INK, MUTED, PAPER, WALL, sheet, styled

GROUPS, REPEATS = 12, 50  # Section V.A
FIRST_M, STEP_M = paper.TESTED_DISTANCE_CM / 100, paper.STEP_CM / 100
_BEAM_WIDTH_RAD = np.radians(22.5)


def places() -> np.ndarray:
    """(x, y) of the 12 groups of three positions before a wall along y = 0, (36, 2)."""
    across = STEP_M * np.array([-1.0, 0.0, 1.0])
    away = FIRST_M + STEP_M * np.arange(GROUPS)
    return np.array([(x, -y) for y in away for x in across])


def wall_survey(rng: np.random.Generator) -> list[SweepReadings]:
    """50 readings of the wall from each place, with the paper's mean and sigma."""
    return [
        _reading(number, x, y, -y + PAPER_BIAS_M + rng.normal(0, PAPER_SIGMA_M))
        for number, (x, y) in enumerate(np.repeat(places(), REPEATS, axis=0))
    ]


def calibrated(rng: np.random.Generator) -> Calibration:
    """What the calibration makes of a simulated survey, told how far off the wall the first group stands."""
    return calibrate(wall_survey(rng), wall_distance_m=FIRST_M)


@styled
def figure_13(calibration: Calibration, note: str) -> Figure:
    """(a) The positions before the wall; (b) the histogram of d with its Gaussian and the paper's."""
    figure = sheet(9.6, 4.6, note)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.9))
    _scheme(left)
    _histogram(right, calibration)
    return figure


def _reading(number: int, x_m: float, y_m: float, range_m: float) -> SweepReadings:
    return SweepReadings(
        identity=("wall", number),
        unit="u1",
        time_s=float(number),
        x_m=x_m,
        y_m=y_m,
        heading_rad=np.pi / 2,
        sigma_position_m=0.0,
        sigma_heading_rad=0.0,
        bearing_rad=np.zeros(1),
        range_m=np.array([range_m]),
        no_echo=np.zeros(1, bool),
        beam_width_rad=float(_BEAM_WIDTH_RAD),
        range_sigma_m=None,
    )


def _scheme(axes: Axes) -> None:
    x, y = places().T
    axes.axhline(0, color=WALL, linewidth=3)
    axes.text(0.33, 0.05, "wall", color=WALL, va="bottom", ha="right")
    for row in np.unique(y):
        axes.plot(x[y == row], y[y == row], color=FAINT, linewidth=1, zorder=0)
    axes.plot(x, y, "o", color=INK, markersize=3.2)
    axes.annotate(
        f"{100 * FIRST_M:.0f} cm",
        (0.3, -FIRST_M / 2),
        ha="left",
        va="center",
        color=MUTED,
    )
    axes.annotate("", (0.27, 0), (0.27, -FIRST_M), arrowprops={"arrowstyle": "<->", "color": MUTED})
    axes.set_title("(a)  Positions")
    axes.set_aspect("equal")
    axes.set(xlabel="along the wall (m)", ylabel="off the wall (m)", xlim=(-0.55, 0.75), ylim=(-2.65, 0.2))


def _histogram(axes: Axes, calibration: Calibration) -> None:
    d_cm = 100 * calibration.spread.deviation_m
    mean_cm, sigma_cm = 100 * calibration.spread.mean_d_m.value, 100 * calibration.spread.sigma_d_m.value
    bins = [0.1 * step for step in range(-16, 17)]
    axes.hist(
        d_cm, bins=bins, density=True, color=FAINT, edgecolor="white", label=f"simulated: {len(d_cm)} values of d"
    )
    at = np.linspace(-1.6, 1.6, 300)
    ours = f"Gaussian of these: mean {round(mean_cm, 2) + 0.0:.2f} cm, sigma {sigma_cm:.2f} cm"  # no -0.00
    axes.plot(at, norm.pdf(at, mean_cm, sigma_cm), color=WALL, label=ours)
    theirs = f"paper, real rig: mean {paper.MEAN_CM:.2f} cm, sigma {paper.SIGMA_CM:.2f} cm"
    axes.plot(at, norm.pdf(at, paper.MEAN_CM, paper.SIGMA_CM), color=PAPER, linestyle=(0, (4, 2)), label=theirs)
    axes.set_title("(b)  $d = R_{2d} - R_2$")
    axes.set(xlabel="d (cm)", ylabel="density (1/cm)", xlim=(-1.6, 1.6), ylim=(0, 1.75))
    axes.legend(loc="upper left")
