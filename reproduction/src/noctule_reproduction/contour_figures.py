"""Figure 18: the contours of all methods, and the paper's own, against the true one."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon

from noctule_reproduction import paper
from noctule_reproduction.comparison import corner_values, cylinder_values
from noctule_reproduction.drawing import WINDOW, draw_contour, draw_room, name_parts
from noctule_reproduction.runs import METHODS, Run
from noctule_reproduction.style import METHOD_COLOURS, METHOD_NAMES, MUTED, PAPER, TRUE, plan, sheet, styled

_SHOWN_CM, _ENLARGED_CM = 10.0, 2.5  # half of what a panel and its inset show
_PAPERS: tuple[tuple[paper.Column, str, str], ...] = (
    ("hough", "s", "paper's HT / RHT, real rig"),
    ("eht-lsm", "D", "paper's EHT + LSM, real rig"),
)
_WIDTHS = {"hough": 2.6, "eht-lsm": 1.8, "refined": 0.9}


@styled
def figure_18(runs: Sequence[Run], note: str) -> Figure:
    """Left: the contours of the first run on the true one. Right: each corner and the cylinder's centre enlarged, with
    those of every run and the paper's own.
    """
    figure = sheet(12.6, 5.3, note)
    axes = figure.subplot_mosaic(
        [["room", "A", "B", "C"], ["room", "D", "E", "F"]], width_ratios=(3.2, 1, 1, 1), height_ratios=(1, 1)
    )
    _contours(axes["room"], runs[0])
    for number, name in enumerate(paper.CORNER_NAMES):
        places = {method: [corner_values(run.contours[method])[number, :2] for run in runs] for method in METHODS}
        printed = [_printed_corner(column, number) for column, _, _ in _PAPERS]
        _cloud(axes[name], f"Corner {name}", np.array(paper.CORNERS["true"][number]), list(places.values()), printed)
    places = {method: [cylinder_values(run.contours[method])[:2] for run in runs] for method in METHODS}
    printed = [np.array(paper.CYLINDER[column][:2]) for column, _, _ in _PAPERS]
    _cloud(axes["F"], "Centre F", np.array(paper.CYLINDER["true"][:2]), list(places.values()), printed)
    figure.legend(handles=_legend(), loc="outside upper left", ncols=6)
    return figure


def _contours(axes: Axes, run: Run) -> None:
    plan(axes, f"Contours of seed {run.seed}, and the paper's EHT + LSM")
    axes.set(**WINDOW)
    for method in METHODS:
        draw_contour(axes, run.contours[method], METHOD_COLOURS[method], _WIDTHS[method])
    draw_room(axes)
    name_parts(axes)
    corners_m = np.array(paper.CORNERS["eht-lsm"]) / 100
    x, y, radius = (value / 100 for value in paper.CYLINDER["eht-lsm"])
    for patch in (Polygon(corners_m), Circle((x, y), radius)):
        patch.set(fill=False, edgecolor=PAPER, linewidth=0.9, zorder=2.5)
        axes.add_patch(patch)


def _printed_corner(column: paper.Column, number: int) -> np.ndarray:
    """A corner of Table II in cm; HT's D, which is misprinted, from the lines of Table I."""
    if column == "hough" and paper.CORNER_NAMES[number] == "D":
        return np.array(paper.HOUGH_CORNER_D_CM)
    return np.array(paper.CORNERS[column][number])


def _cloud(
    axes: Axes, title: str, true: np.ndarray, found: Sequence[list[np.ndarray]], printed: Sequence[np.ndarray]
) -> None:
    """Where each run has one corner or centre by each of the methods, in centimetres off the true place."""
    inset = axes.inset_axes((0.02, 0.02, 0.4, 0.4))
    for panel, half_cm, size in ((axes, _SHOWN_CM, 2.2), (inset, _ENLARGED_CM, 2.6)):
        for method, places in zip(METHODS, found, strict=True):
            off = np.array(places) - true
            panel.plot(*off.T, "o", color=METHOD_COLOURS[method], markersize=size, alpha=0.6, markeredgewidth=0)
        panel.plot(0, 0, "+", color=TRUE, markersize=9, markeredgewidth=1, zorder=5)
        panel.set_aspect("equal")
        panel.set(xlim=(-half_cm, half_cm), ylim=(-half_cm, half_cm))
    for (_, mark, _), place in zip(_PAPERS, printed, strict=True):
        axes.plot(*(place - true), mark, color=PAPER, markerfacecolor="none", markersize=5)
    inset.set(xticks=[], yticks=[])
    inset.text(0.04, 0.03, f"±{_ENLARGED_CM:g} cm", fontsize=6, color=MUTED, transform=inset.transAxes)
    for side in inset.spines.values():
        side.set(visible=True, color=MUTED, linewidth=0.6)
    beyond = int((np.abs(np.array(found) - true).max(axis=2) > _SHOWN_CM).sum())
    if beyond:
        axes.text(0.97, 0.97, f"{beyond} beyond", fontsize=7, ha="right", va="top", transform=axes.transAxes)
    axes.set_title(title)
    axes.set(xlabel="x off (cm)", ylabel="y off (cm)", xticks=(-5, 0, 5), yticks=(-5, 0, 5))


def _legend() -> list[Line2D]:
    true = Line2D([], [], color=TRUE, marker="+", linestyle=(0, (5, 3)), linewidth=1, markersize=8, label="true")
    ours = [
        Line2D(
            [], [], color=METHOD_COLOURS[method], marker="o", markersize=4, label=f"{METHOD_NAMES[method]}, simulated"
        )
        for method in METHODS
    ]
    theirs = [
        Line2D([], [], color=PAPER, marker=mark, markerfacecolor="none", linestyle="", label=name)
        for _, mark, name in _PAPERS
    ]
    return [true, *ours, *theirs]
