"""The turntable seen from above: bearings, home, and how far the sensor may turn."""

from itertools import pairwise
from math import cos, radians, sin

from schemdraw import Drawing
from schemdraw import elements as elm
from sheet import Point, sheet, text

RADIUS = 4.5
LAST_BEARING_DEG = 148  # either way, the farthest that a plan may look
HOME_DEG, RUN_ON_DEG = -150, -165  # where the switch closes, and how far it must stay closed
RED = "#c00000"


def drawing() -> Drawing:
    paper = sheet()
    _arc(paper, -LAST_BEARING_DEG, LAST_BEARING_DEG, "black")
    for degrees in range(-135, 136, 45):
        _ray(paper, degrees, RADIUS, RADIUS + 0.3)
        _mark(paper, degrees, RADIUS + 1, f"{degrees:+d}°".replace("-", "–") if degrees else "0°, forward")
    _ray(paper, -LAST_BEARING_DEG, RADIUS - 0.3, RADIUS)
    _ray(paper, LAST_BEARING_DEG, RADIUS - 0.3, RADIUS)
    _mark(paper, LAST_BEARING_DEG + 12, RADIUS + 0.9, f"+{LAST_BEARING_DEG}°, the last bearing")
    _arc(paper, RUN_ON_DEG, HOME_DEG, RED)
    _ray(paper, HOME_DEG, RADIUS, RADIUS + 1, RED)
    text(
        paper, (0, -6.6), f"home switch: pressed from –{-HOME_DEG}° to –{-RUN_ON_DEG}° at least (red)", halign="center"
    )
    _sensor(paper)
    return paper


def _sensor(paper: Drawing) -> None:
    paper += elm.Dot().at((0, 0))
    text(paper, (0.25, -0.4), "axis of the shaft", size=10)
    paper += elm.Rect(corner1=(-1.6, 0.5), corner2=(1.6, 0.9), lw=2, fill="#f4f4f4").at((0, 0)).theta(0)
    for left in (-1.3, 0.3):
        paper += elm.Rect(corner1=(left, 0.9), corner2=(left + 1, 1.6), lw=2, fill="#f4f4f4").at((0, 0)).theta(0)
    text(paper, (2, 1.1), "HC-SR04", size=10)
    paper += elm.Line(arrow="->").at((0, 2)).to((0, 3.6)).theta(90)
    paper += elm.Arc2(arrow="->", k=-0.3).at((-1.2, -1.3)).to((1.2, -1.3))
    text(paper, (0, -2.6), "bearings rise this way, anticlockwise", size=10, halign="center")


def _at(radius: float, degrees: float) -> Point:
    """Forward is up the page, and bearings rise anticlockwise."""
    return -radius * sin(radians(degrees)), radius * cos(radians(degrees))


def _arc(paper: Drawing, first: int, last: int, color: str) -> None:
    chords = (last - first) // 5
    points = [_at(RADIUS, first + (last - first) * number / chords) for number in range(chords + 1)]
    for start, end in pairwise(points):
        paper.add(elm.Line(color=color, lw=3).at(start).to(end))


def _ray(paper: Drawing, degrees: float, inner: float, outer: float, color: str = "black") -> None:
    paper.add(elm.Line(color=color).at(_at(inner, degrees)).to(_at(outer, degrees)))


def _mark(paper: Drawing, degrees: float, radius: float, words: str) -> None:
    text(paper, _at(radius, degrees), words, halign="center")
