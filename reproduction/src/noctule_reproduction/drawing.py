"""The true room and a contour, as lines on a plan."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from noctule_mapper.contour.contour import Contour
from noctule_reproduction import paper
from noctule_reproduction.style import MUTED, TRUE

WINDOW: Mapping[str, tuple[float, float]] = {"xlim": (-1.35, 2.8), "ylim": (-1.15, 2.05)}
CORNERS_M = np.array(paper.CORNERS["true"]) / 100
CENTRE_M = (paper.CYLINDER["true"][0] / 100, paper.CYLINDER["true"][1] / 100)
RADIUS_M = paper.CYLINDER["true"][2] / 100
_DASHED = (0, (5, 3))


def draw_room(axes: Axes) -> None:
    """The true outline and cylinder, dashed."""
    axes.add_patch(Polygon(CORNERS_M, fill=False, edgecolor=TRUE, linewidth=1.0, linestyle=_DASHED, zorder=2))
    axes.add_patch(Circle(CENTRE_M, RADIUS_M, fill=False, edgecolor=TRUE, linewidth=1.0, linestyle=_DASHED, zorder=2))


def name_parts(axes: Axes) -> None:
    """The paper's names: walls 1-5, corners A-E, the cylinder F (6)."""
    centre = CORNERS_M.mean(axis=0)
    for number, (start, end) in enumerate(zip(CORNERS_M, np.roll(CORNERS_M, -1, axis=0), strict=True)):
        away = (start - centre) / np.hypot(*(start - centre))
        x, y = start + 0.13 * away
        axes.text(x, y, paper.CORNER_NAMES[number], ha="center", va="center", fontweight="bold")
        along = (end - start) / np.hypot(*(end - start))
        x, y = (start + end) / 2 + 0.11 * np.array([-along[1], along[0]])
        axes.text(x, y, str(number + 1), ha="center", va="center")
    axes.text(*CENTRE_M, "F (6)", ha="center", va="center", color=MUTED)


def draw_contour(axes: Axes, contour: Contour, colour: str, width: float) -> None:
    """Walls and cylinders."""
    for wall in contour.walls:
        axes.plot(*zip(wall.start, wall.end, strict=True), color=colour, linewidth=width, zorder=3)
    for one in contour.cylinders:
        place = (one.x_m, one.y_m)
        axes.add_patch(Circle(place, one.radius_m, fill=False, edgecolor=colour, linewidth=width, zorder=3))
