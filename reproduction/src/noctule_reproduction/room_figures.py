"""Figure 17: the paper's room, its survey, the reliability grid, and the contour from its feature points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon

from noctule_mapper.contacts.voting import Kind
from noctule_mapper.contour.contour import Contour
from noctule_mapper.paper.features import FeaturePoints
from noctule_mapper.readings.sweep import SweepReadings
from noctule_reproduction.drawing import (
    CENTRE_M,
    CORNERS_M,
    RADIUS_M,
    WINDOW,
    draw_contour,
    draw_room,
    name_parts,
)
from noctule_reproduction.raster import Raster
from noctule_reproduction.style import (
    CORNER,
    CYLINDER,
    FAINT,
    FREE_SPACE,
    INK,
    METHOD_COLOURS,
    RELIABILITY,
    WALL,
    plan,
    sheet,
    styled,
)

_KINDS = ((Kind.WALL, "wall", WALL), (Kind.CYLINDER, "cylinder", CYLINDER), (Kind.CORNER, "corner", CORNER))
_SHOWN_SWEEP = 5  # whose bearings are drawn


@dataclass(frozen=True)
class Survey:
    """One seed's sweeps and what they have put on the map."""

    sweeps: Sequence[SweepReadings]
    occupied: Raster
    free: Raster
    points: FeaturePoints
    contour: Contour


@styled
def figure_17(survey: Survey, note: str) -> Figure:
    """Environment, planned positions, reliability grid, feature points with the contour."""
    figure = sheet(10.4, 8.4, note)
    panels = figure.subplots(2, 2).ravel()
    titles = ("(a)  Environment", "(b)  Planned positions", "(c)  Reliability grid", "(d)  Feature points and contour")
    for axes, title in zip(panels, titles, strict=True):
        plan(axes, title)
        axes.set(**WINDOW)
    _environment(panels[0])
    _positions(panels[1], survey.sweeps)
    _grid(panels[2], survey)
    _features(panels[3], survey)
    return figure


def _environment(axes: Axes) -> None:
    axes.add_patch(Polygon(CORNERS_M, facecolor="#f6f7f9", edgecolor=INK, linewidth=2.2))
    axes.add_patch(Circle(CENTRE_M, RADIUS_M, facecolor=FAINT, edgecolor=INK, linewidth=2.2))
    name_parts(axes)


def _positions(axes: Axes, sweeps: Sequence[SweepReadings]) -> None:
    draw_room(axes)
    x, y, heading = (np.array([getattr(one, name) for one in sweeps]) for name in ("x_m", "y_m", "heading_rad"))
    axes.plot(np.append(x, x[0]), np.append(y, y[0]), color=FAINT, linewidth=1, zorder=1)
    axes.quiver(x, y, np.cos(heading), np.sin(heading), color=INK, scale=38, width=0.0035, pivot="tail", zorder=3)
    axes.plot(x, y, "o", color=INK, markersize=2.5)
    shown = sweeps[_SHOWN_SWEEP]
    for direction in shown.direction_rad:
        ends = [shown.x_m, shown.x_m + 0.3 * np.cos(direction)], [shown.y_m, shown.y_m + 0.3 * np.sin(direction)]
        axes.plot(*ends, color=WALL, linewidth=0.8, zorder=2)
    label = {"textcoords": "offset points", "ha": "left", "va": "top", "fontsize": 8}
    axes.annotate("start, end", (x[0], y[0]), xytext=(3, -5), **label)
    axes.annotate("13 bearings", (shown.x_m, shown.y_m), xytext=(-22, 32), color=WALL, **label)


def _grid(axes: Axes, survey: Survey) -> None:
    for picture, colours in ((survey.free, FREE_SPACE), (survey.occupied, RELIABILITY)):
        axes.imshow(
            picture.values,
            extent=picture.extent,
            origin="lower",
            cmap=colours,
            vmin=0,
            vmax=1,
            interpolation="nearest",
        )
    axes.set(**WINDOW)
    names = (("occupied", RELIABILITY(0.8)), ("free", FREE_SPACE(1.0)))
    handles = [
        Line2D([], [], marker="s", linestyle="", color=colour, markersize=8, label=f"$m({name[0].upper()})$ {name}")
        for name, colour in names
    ]
    axes.legend(handles=handles, loc="upper right")


def _features(axes: Axes, survey: Survey) -> None:
    draw_room(axes)
    draw_contour(axes, survey.contour, METHOD_COLOURS["eht-lsm"], 2.2)
    for kind, name, colour in _KINDS:
        points = survey.points.take(survey.points.kind == kind)
        axes.plot(points.x_m, points.y_m, "o", color=colour, markersize=3.2, label=name, zorder=4, markeredgewidth=0)
    axes.plot([], [], color=METHOD_COLOURS["eht-lsm"], linewidth=2.4, label="contour, EHT + LSM")
    axes.legend(loc="upper right", ncols=2)
