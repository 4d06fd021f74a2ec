"""Figures 9, 11 and 12: what the Hough transform is, its accumulator over a survey, and the classes that it gives."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc

from noctule_mapper.paper.features import FeaturePoints
from noctule_mapper.paper.hough_transform import LineAccumulator
from noctule_mapper.paper.walls import FittedWall
from noctule_reproduction.style import CORNER, FAINT, INK, MUTED, RELIABILITY, SERIES, WALL, plan, sheet, styled

_NEAR_RAD, _NEAR_M = np.radians(15), 0.2  # what is shown about the highest peak


@styled
def figure_9(points_m: np.ndarray, theta_rad: float, rho_m: float, note: str) -> Figure:
    """(a) A line's theta and rho; (b) points (n, 2) of the line as curves that meet there."""
    figure = sheet(9.6, 4.2, note)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.25))
    _line_scheme(left, points_m, theta_rad, rho_m)
    theta = np.linspace(0, np.pi, 400)
    for (x, y), colour in zip(points_m, SERIES, strict=False):
        left.plot(x, y, "o", color=colour, markersize=5, zorder=4)
        right.plot(theta, x * np.cos(theta) + y * np.sin(theta), color=colour, linewidth=1.3)
    right.plot(theta_rad, rho_m, "o", color=INK, markerfacecolor="none", markersize=11)
    label = f"$\\theta$ = {theta_rad:.3f} rad, $\\rho$ = {rho_m:.3f} m"
    right.annotate(label, (theta_rad, rho_m), xytext=(10, 16), textcoords="offset points")
    right.set_title("(b)  Each point is a curve; on one line they meet")
    right.set(xlabel="$\\theta$ (rad)", ylabel="$\\rho = x\\,\\cos\\theta + y\\,\\sin\\theta$ (m)", xlim=(0, np.pi))
    return figure


@styled
def figure_11(accumulator: LineAccumulator, note: str) -> Figure:
    """(a) The accumulator of all feature points as a surface; (b) the bins about its highest peak."""
    figure = sheet(10.6, 4.6, note)
    theta, rho, votes = accumulator.peak()
    surface = figure.add_subplot(1, 2, 1, projection="3d")
    pooled_rho, pooled = _pooled(accumulator)
    grid_theta, grid_rho = np.meshgrid(accumulator.theta_rad, pooled_rho, indexing="ij")
    surface.plot_surface(grid_theta, grid_rho, pooled, cmap=RELIABILITY, rcount=400, ccount=400, linewidth=0)
    surface.plot([theta], [rho], [votes], "o", color=CORNER, markersize=5)
    surface.text(theta, rho, votes * 1.08, f"{votes} votes", color=CORNER)
    surface.set(xlabel="$\\theta$ (rad)", ylabel="$\\rho$ (m)", zlabel="votes")
    surface.set_title("(a)  Votes for lines")
    surface.view_init(elev=32, azim=-62)
    axes = figure.add_subplot(1, 2, 2)
    _bins(axes, accumulator)
    axes.plot(theta, rho, "s", color=CORNER, markerfacecolor="none", markersize=15, markeredgewidth=1.6)
    label = f"$\\theta$ = {theta:.3f} rad\n$\\rho$ = {rho:.3f} m"
    axes.annotate(label, (theta, rho), xytext=(16, 14), textcoords="offset points", color=CORNER)
    axes.set_title("(b)  The bins about the highest peak")
    axes.set(xlabel="$\\theta$ (rad)", ylabel="$\\rho$ (m)")
    return figure


def _pooled(accumulator: LineAccumulator) -> tuple[np.ndarray, np.ndarray]:
    """Middles of every four bins of rho, and the most votes in them, (thetas, rhos / 4)."""
    whole = len(accumulator.rho_m) // 4 * 4
    votes = accumulator.votes[:, :whole].reshape(len(accumulator.theta_rad), -1, 4)
    return accumulator.rho_m[:whole].reshape(-1, 4).mean(axis=1), votes.max(axis=2)


def _bins(axes: Axes, accumulator: LineAccumulator) -> None:
    theta, rho, _ = accumulator.peak()
    near_theta = np.nonzero(np.abs(accumulator.theta_rad - theta) < _NEAR_RAD)[0]
    near_rho = np.nonzero(np.abs(accumulator.rho_m - rho) < _NEAR_M)[0]
    image = axes.pcolormesh(
        accumulator.theta_rad[near_theta],
        accumulator.rho_m[near_rho],
        accumulator.votes[np.ix_(near_theta, near_rho)].T,
        cmap=RELIABILITY,
        shading="nearest",
    )
    axes.figure.colorbar(image, ax=axes, label="votes", shrink=0.8)


@styled
def figure_12(points: FeaturePoints, walls: Sequence[FittedWall], note: str) -> Figure:
    """The feature points, a colour for each class that the extended Hough transform makes; ``walls`` count by them."""
    figure = sheet(7.0, 6.2, note)
    axes = figure.subplots()
    plan(axes, "Feature points by class")
    classed = np.concatenate([np.zeros(0, int), *(wall.members for wall in walls)])
    rest = np.setdiff1d(np.arange(len(points.x_m)), classed)
    label = f"no line: {len(rest)} points"
    axes.plot(points.x_m[rest], points.y_m[rest], "o", color=MUTED, markersize=5, markeredgewidth=0, label=label)
    for number, (wall, colour) in enumerate(zip(walls, SERIES, strict=False), start=1):
        members = points.take(wall.members)
        ends = np.array([wall.line.at(wall.line.low_m), wall.line.at(wall.line.high_m)])
        axes.plot(*ends.T, color=colour, linewidth=1, alpha=0.6)
        label = f"peak {number}: {len(wall.members)} points"
        axes.plot(members.x_m, members.y_m, "o", color=colour, markersize=5, markeredgewidth=0, label=label)
    axes.margins(0.06)
    figure.legend(loc="outside upper left", ncols=3)
    return figure


def _line_scheme(axes: Axes, points_m: np.ndarray, theta_rad: float, rho_m: float) -> None:
    plan(axes, "(a)  A line has a normal's direction $\\theta$ and a distance $\\rho$")
    normal = np.array([np.cos(theta_rad), np.sin(theta_rad)])
    foot, tangent = rho_m * normal, np.array([-normal[1], normal[0]])
    along = points_m @ tangent
    ends = foot + np.outer([along.min() - 0.25, along.max() + 0.25], tangent)
    axes.plot(*ends.T, color=WALL, linewidth=1.8)
    axes.annotate(
        "", (foot[0], foot[1]), (0, 0), arrowprops={"arrowstyle": "-|>", "color": INK, "shrinkA": 0, "shrinkB": 0}
    )
    axes.add_patch(Arc((0, 0), 0.7, 0.7, theta1=0, theta2=np.degrees(theta_rad), color=MUTED))
    middle = theta_rad / 2
    axes.text(0.46 * np.cos(middle), 0.46 * np.sin(middle), "$\\theta$", ha="center", va="center", fontsize=11)
    x, y = 0.55 * foot + 0.1 * tangent
    axes.text(x, y, "$\\rho$", ha="center", va="center", fontsize=11)
    axes.axhline(0, color=FAINT, linewidth=1, zorder=0)
    axes.axvline(0, color=FAINT, linewidth=1, zorder=0)
    axes.set_ylim(bottom=-0.2)
