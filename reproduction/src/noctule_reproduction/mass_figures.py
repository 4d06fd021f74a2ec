"""Figure 3: what one reading says along its range, Eq. 5-8 as printed and with Eq. 7 corrected."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from noctule_mapper.fusion.sensor_model import arc_masses, free_mass
from noctule_reproduction.style import FREE, OCCUPIED, UNKNOWN, sheet, styled

RANGE_M, EPSILON_M = 3.0, 0.002  # the paper's example, and its eps
BEAM_WIDTH_RAD = np.radians(22.5)


@dataclass(frozen=True)
class MassCurves:
    """Beliefs (n, 3) of occupied, free and unknown at distances (n,), at one angle off the axis; ``printed``: by Eq. 7
    as it stands.
    """

    angle_rad: float
    distance_m: np.ndarray
    masses: np.ndarray
    printed: np.ndarray


def mass_curves(angle_rad: float) -> MassCurves:
    """The beliefs about a range of 3.0 m, eps 2 mm, beam 22.5 degrees."""
    distance = RANGE_M + np.linspace(-3 * EPSILON_M, 3 * EPSILON_M, 1201)
    masses = arc_masses(distance, angle_rad, RANGE_M, EPSILON_M, BEAM_WIDTH_RAD)
    free = free_mass(distance, angle_rad, RANGE_M, EPSILON_M, BEAM_WIDTH_RAD)
    on_arc = np.abs(distance - RANGE_M) <= EPSILON_M
    elsewhere = np.array([0.0, 1.0, 0.0])  # Eq. 6-8 off the arc, as printed
    return MassCurves(
        angle_rad,
        distance,
        np.where((distance < RANGE_M - EPSILON_M)[:, None], np.stack([0 * free, free, 1 - free], axis=1), masses),
        np.where(on_arc[:, None], masses, elsewhere),
    )


@styled
def figure_3(curves: Sequence[MassCurves], note: str) -> Figure:
    """The masses across the arc at each angle, a panel for each."""
    figure = sheet(3.1 * len(curves) + 0.6, 3.1, note)
    panels = figure.subplots(1, len(curves), sharex=True, sharey=True)
    for axes, curve, letter in zip(panels, curves, "abcd", strict=False):
        _masses(axes, curve, letter)
    panels[0].set_ylabel("belief")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=4)
    return figure


def _masses(axes: Axes, curve: MassCurves, letter: str) -> None:
    off_mm = (curve.distance_m - RANGE_M) * 1000
    names = ("$m(O)$ occupied", "$m(F)$ free", "$m(O \\cup F)$ unknown")
    for column, (name, colour) in enumerate(zip(names, (OCCUPIED, FREE, UNKNOWN), strict=True)):
        axes.plot(off_mm, curve.masses[:, column], color=colour, label=name)
    axes.plot(off_mm, curve.printed[:, 1], color=FREE, linestyle=(0, (2, 2)), linewidth=1, label="$m(F)$ as printed")
    axes.axvspan(-EPSILON_M * 1000, EPSILON_M * 1000, color="#f3f4f6", zorder=0)
    where = ", outside the beam" if curve.angle_rad > BEAM_WIDTH_RAD / 2 else ""
    axes.set_title(f"({letter})  $\\theta$ = {np.degrees(curve.angle_rad):.0f}°{where}")
    axes.set(xlabel="$d - R$ (mm)", ylim=(-0.03, 1.06), xlim=(off_mm[0], off_mm[-1]))
