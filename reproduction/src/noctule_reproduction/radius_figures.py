"""Figures 14 and 15: which cylinders three positions on a line tell from a wall."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle

from noctule_mapper.contacts.r2d import contour_type
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.paper.detectable import greatest_radius_as_printed_m, greatest_radius_m
from noctule_mapper.readings.collinear import deviation_sigma_m, reference_range_m
from noctule_reproduction import paper
from noctule_reproduction.specular import PAPER_SIGMA_M
from noctule_reproduction.style import CYLINDER, FAINT, INK, MUTED, SERIES, WALL, plan, sheet, styled

STEP_M, DISTANCE_M = paper.STEP_CM / 100, paper.TESTED_DISTANCE_CM / 100
RADII_M = tuple(radius_cm / 100 for radius_cm in paper.TESTED_RADII_CM)
_SIGMA, _STEP = np.array(PAPER_SIGMA_M), np.array(STEP_M)
THRESHOLD_M = float(deviation_sigma_m((_SIGMA, _SIGMA, _SIGMA), _STEP, 2 * _STEP))  # sigma of d
TRIES = 20  # for each seed and reflector
_PLACES_M = STEP_M * np.array([-1.0, 0.0, 1.0])
_HALF_BEAM_DEG = 11.25


@dataclass(frozen=True)
class TestedReflector:
    """A cylinder, or a wall of infinite radius, heard from three positions again and again: ranges (n, 3), d = R2d - R2
    and its kind by Eq. 2 with Th = sigma and with 3 sigma, (n,).
    """

    radius_m: float
    range_m: np.ndarray
    deviation_m: np.ndarray
    kind: np.ndarray
    kind_3_sigma: np.ndarray

    @property
    def told_right(self) -> tuple[float, float]:
        """Share of the tries whose kind is the true one, with Th = sigma and with 3 sigma."""
        true = Kind.CYLINDER if np.isfinite(self.radius_m) else Kind.WALL
        return float((self.kind == true).mean()), float((self.kind_3_sigma == true).mean())


def tested(radius_m: float, tries: int, rng: np.random.Generator) -> TestedReflector:
    """Ranges of a reflector 30 cm before the middle of three positions 20 cm apart, with the paper's sigma."""
    true_m = np.full(3, DISTANCE_M)
    if np.isfinite(radius_m):
        true_m = np.hypot(_PLACES_M, DISTANCE_M + radius_m) - radius_m
    range_m = true_m + rng.normal(0, PAPER_SIGMA_M, (tries, 3))
    first_m, second_m, third_m = range_m.T
    d_m = reference_range_m(first_m, third_m, _STEP, 2 * _STEP) - second_m
    kinds = [contour_type(d_m, np.array(sigmas * THRESHOLD_M)) for sigmas in (1, 3)]
    return TestedReflector(radius_m, range_m, d_m, *kinds)


@styled
def figure_14(reflectors: Sequence[TestedReflector], note: str) -> Figure:
    """Above: positions, arcs and each cylinder; below: d of every try against Th. The wall comes first."""
    figure = sheet(10.4, 6.4, note)
    cylinders = reflectors[1:]
    panels = figure.subplot_mosaic(
        [[f"r{n}" for n in range(len(cylinders))], ["d"] * len(cylinders)], height_ratios=(1, 0.95)
    )
    for number, (one, letter) in enumerate(zip(cylinders, "abcdef", strict=False)):
        _arcs(panels[f"r{number}"], one, f"({letter})  r = {100 * one.radius_m:.2f} cm")
        if number:
            panels[f"r{number}"].set_ylabel("")
    _deviations(panels["d"], reflectors)
    return figure


@styled
def figure_15(note: str) -> Figure:
    """(a) The three positions before a cylinder; (b) the greatest radius told from a wall against the distance."""
    figure = sheet(10.0, 5.0, note)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.7))
    _scheme(left)
    distance_m = np.linspace(0.2, 1.2, 200)
    cases = ((0.2, 1), (0.3, 3), (0.2, 3), (0.1, 1))
    for (step_m, sigmas), colour in zip(cases, SERIES, strict=False):
        d_m = sigmas * paper.SIGMA_CM / 100
        name = f"$l_{{step}}$ = {100 * step_m:.0f} cm, d = {100 * d_m:.2f} cm"
        corrected = 100 * np.asarray(greatest_radius_m(distance_m, step_m, d_m))
        printed = 100 * np.asarray(greatest_radius_as_printed_m(distance_m, step_m, d_m))
        right.plot(100 * distance_m, np.where(corrected > 0, corrected, np.nan), color=colour, label=name)
        right.plot(100 * distance_m, np.where(printed > 0, printed, np.nan), color=colour, linestyle=(0, (3, 2)))
    right.plot([], [], color=MUTED, label="corrected: $l^2/2d - L + d/2$")
    right.plot([], [], color=MUTED, linestyle=(0, (3, 2)), label="as printed: $l^2/4d - L$")
    right.set_title("(b)  Greatest radius that is told from a wall")
    right.set(xlabel="L (cm)", ylabel="R (cm)", xlim=(20, 120), ylim=(0, 640))
    figure.legend(loc="outside upper left", ncols=3)
    return figure


def _arcs(axes: Axes, one: TestedReflector, title: str) -> None:
    """The first try: its three arcs, each about the way to the cylinder."""
    plan(axes, title)
    axes.add_patch(Circle((0, DISTANCE_M + one.radius_m), one.radius_m, facecolor=FAINT, edgecolor=INK, linewidth=1))
    for x, range_m in zip(_PLACES_M, one.range_m[0], strict=True):
        towards = np.degrees(np.arctan2(DISTANCE_M + one.radius_m, -x))
        ends = (towards - _HALF_BEAM_DEG, towards + _HALF_BEAM_DEG)
        for end in np.radians(ends):
            axes.plot([x, x + range_m * np.cos(end)], [0, range_m * np.sin(end)], color=FAINT, linewidth=0.7, zorder=0)
        arc = Arc((x, 0), 2 * range_m, 2 * range_m, theta1=ends[0], theta2=ends[1], color=CYLINDER, linewidth=1.8)
        axes.add_patch(arc)
    axes.plot(_PLACES_M, np.zeros(3), "o", color=INK, markersize=4)
    axes.set(xlim=(-0.3, 0.3), ylim=(-0.04, 0.74))


def _deviations(axes: Axes, reflectors: Sequence[TestedReflector]) -> None:
    for row, one in enumerate(reflectors):
        wall = not np.isfinite(one.radius_m)
        d_cm = 100 * one.deviation_m
        spread = np.linspace(-0.28, 0.28, len(d_cm))  # apart, so that each try is seen
        axes.plot(
            d_cm, row + spread, "o", color=WALL if wall else CYLINDER, markersize=2.2, markeredgewidth=0, alpha=0.5
        )
        share, share_3 = one.told_right
        text = f"told right: {100 * share:.1f} % at Th = $\\sigma$, {100 * share_3:.1f} % at $3\\sigma$"
        axes.text(9.9, row, text, va="center", ha="right", fontsize=8)
    for sigmas in (-3, -1, 1, 3):
        axes.axvline(sigmas * 100 * THRESHOLD_M, color=MUTED, linewidth=0.9, linestyle=(0, (2, 2)), zorder=0)
    name = f"dashed: Th = $\\sigma$ = {100 * THRESHOLD_M:.2f} cm, and $3\\sigma$"
    axes.text(3.2 * 100 * THRESHOLD_M, len(reflectors) - 0.35, name, color=MUTED, fontsize=8)
    names = ["wall" if not np.isfinite(one.radius_m) else f"r = {100 * one.radius_m:.2f} cm" for one in reflectors]
    axes.set_yticks(range(len(reflectors)), names)
    axes.set(xlabel="$d = R_{2d} - R_2$ (cm)", xlim=(-1.6, 10.0), ylim=(-0.6, len(reflectors) + 0.1))
    axes.set_title("(e)  Eq. 2")


def _scheme(axes: Axes) -> None:
    plan(axes, "(a)  $(R + L)^2 = l_{step}^2 + (R + L - d)^2$")
    radius, distance = 0.16, 0.3
    axes.add_patch(Circle((0, distance + radius), radius, facecolor=FAINT, edgecolor=INK, linewidth=1))
    axes.plot(_PLACES_M, np.zeros(3), "o", color=INK, markersize=5)
    for x, name in zip(_PLACES_M, ("$P_1$", "$P_2$", "$P_3$"), strict=True):
        axes.text(x, -0.035, name, ha="center", va="top")
        axes.plot([x, 0], [0, distance + radius], color=MUTED, linewidth=0.8, linestyle=(0, (2, 2)))
    axes.text(0.012, 0.07, "$R_2 = L - d$", va="center")
    axes.text(0.125, 0.2, "$R_3 = L$", va="center")
    axes.text(-0.125, 0.2, "$R_1 = L$", va="center", ha="right")
    axes.text(-0.045, distance + radius + 0.02, "R", ha="center")
    axes.annotate("", (0, -0.012), (0.2, -0.012), arrowprops={"arrowstyle": "<->", "color": MUTED})
    axes.text(0.1, -0.03, "$l_{step}$", ha="center", va="top", color=MUTED)
    axes.set(xlim=(-0.32, 0.32), ylim=(-0.09, 0.66))
