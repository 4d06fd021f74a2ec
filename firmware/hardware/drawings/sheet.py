"""What the drawings share: the paper, and the smallest parts."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Literal

from schemdraw import Drawing
from schemdraw import elements as elm

Point = tuple[float, float]
Side = Literal["left", "center", "right"]
Pins = Mapping[str, float]
"""The name of each pin and its height on the paper."""


def sheet() -> Drawing:
    drawing = Drawing(show=False)
    drawing.config(fontsize=12, bgcolor="white", margin=0.8, unit=2, inches_per_unit=0.42)
    return drawing


def wire(drawing: Drawing, *points: Point) -> None:
    """A wire through the points, horizontal and vertical as they say."""
    for start, end in pairwise(points):
        drawing += elm.Line().at(start).to(end)


def dot(drawing: Drawing, at: Point) -> None:
    drawing += elm.Dot().at(at)


def ground(drawing: Drawing, at: Point) -> None:
    """GND at the chip's board: bars."""
    drawing += elm.Ground().at(at)


def star(drawing: Drawing, at: Point) -> None:
    """The ground star, at the supply: a triangle."""
    drawing += elm.GroundSignal().at(at)


def supply(drawing: Drawing, at: Point, volts: str) -> None:
    drawing += elm.Vdd().at(at).label(volts)


def text(drawing: Drawing, at: Point, words: str, size: float = 11, halign: Side = "left") -> None:
    drawing += elm.Label().at(at).theta(0).label(words, fontsize=size, halign=halign, ofst=0)


def part(
    drawing: Drawing, left: float, right: float, title: str, pins_left: Pins, pins_right: Pins, low: float
) -> None:
    """A box from ``left`` to ``right`` with the name of each pin at its height, its lower edge at ``low``."""
    top = max([*pins_left.values(), *pins_right.values()]) + 1
    drawing += elm.Rect(corner1=(left, low), corner2=(right, top), lw=2, fill="#f4f4f4").at((0, 0)).theta(0)
    text(drawing, ((left + right) / 2, top + 0.35), title, size=13, halign="center")
    for name, height in pins_left.items():
        text(drawing, (left + 0.2, height), name)
    for name, height in pins_right.items():
        text(drawing, (right - 0.2, height), name, halign="right")
