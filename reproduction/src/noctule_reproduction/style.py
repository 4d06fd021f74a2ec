"""How all figures look: one palette, units on axes, plans to scale."""

from io import BytesIO

import matplotlib
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

INK, MUTED, FAINT = "#22272e", "#6e7781", "#d8dce1"
TRUE, PAPER = INK, "#8d5fb8"
METHOD_COLOURS = {"hough": "#d9822b", "eht-lsm": "#2b6cb0", "refined": "#1f9d6b"}
METHOD_NAMES = {"hough": "Hough / RHT", "eht-lsm": "EHT + LSM", "refined": "refined"}
WALL, CYLINDER, CORNER = "#2b6cb0", "#d9822b", "#b83280"
OCCUPIED, FREE, UNKNOWN = "#c2410c", "#0f766e", "#6e7781"
SERIES = ("#2b6cb0", "#d9822b", "#1f9d6b", "#b83280", "#8d5fb8", "#a16207", "#0e7490", "#9f1239")
RELIABILITY = LinearSegmentedColormap.from_list(  # nothing is transparent
    "reliability", ["#ffffff00", "#bfe0dc", "#4aa3a8", "#1c5d7a", "#0c2340"]
)
FREE_SPACE = LinearSegmentedColormap.from_list("free", ["#ffffff00", "#f3d9a4"])

styled = matplotlib.rc_context(
    {
        "font.family": "DejaVu Sans",
        "font.size": 8.5,
        "text.color": INK,
        "axes.labelcolor": INK,
        "axes.titlesize": 9.5,
        "axes.titlelocation": "left",
        "axes.titlepad": 7,
        "axes.edgecolor": MUTED,
        "axes.linewidth": 0.8,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "xtick.color": MUTED,
        "ytick.color": MUTED,
        "xtick.labelcolor": INK,
        "ytick.labelcolor": INK,
        "legend.frameon": False,
        "legend.fontsize": 8,
        "legend.handlelength": 1.6,
        "lines.linewidth": 1.6,
        "figure.dpi": 150,
    }
)


def sheet(width_in: float, height_in: float, note: str) -> Figure:
    """An empty figure that bears ``note`` at its foot: where its data come from, should it ever stand alone."""
    figure = Figure(figsize=(width_in, height_in), layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08))
    figure.supxlabel(note, x=0.995, ha="right", fontsize=7, color=MUTED)
    return figure


def plan(axes: Axes, title: str) -> None:
    """Make ``axes`` a plan in metres, to scale."""
    axes.set_title(title)
    axes.set_aspect("equal")
    axes.set(xlabel="x (m)", ylabel="y (m)")


def png(figure: Figure) -> bytes:
    """The figure as a PNG image."""
    stream = BytesIO()
    figure.savefig(stream, format="png", facecolor="white", metadata={"Software": None})
    return stream.getvalue()
