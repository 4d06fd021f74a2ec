"""The turntable from above (bearings, home, how far the sensor may turn) and from the side (which piece is where)."""

from itertools import pairwise
from math import cos, radians, sin

from schemdraw import Drawing
from schemdraw import elements as elm
from sheet import Point, sheet, text

RADIUS = 4.5
LAST_BEARING_DEG = 148  # either way, the farthest that a plan may look
HOME_DEG, RUN_ON_DEG = -150, -175  # where the cam presses the switch
PEG_DEG = 175  # either way
RED, GREY = "#c00000", "#f4f4f4"
SIDE = 14.0  # the shaft of the side view, from the left
FLOOR = -4.0


def drawing() -> Drawing:
    paper = sheet()
    _arc(paper, -LAST_BEARING_DEG, LAST_BEARING_DEG, "black")
    for degrees in range(-135, 136, 45):
        _ray(paper, degrees, RADIUS, RADIUS + 0.3)
        _mark(paper, degrees, RADIUS + 1, f"{degrees:+d}°".replace("-", "–") if degrees else "0°, forward")
    _ray(paper, -LAST_BEARING_DEG, RADIUS - 0.3, RADIUS)
    _ray(paper, LAST_BEARING_DEG, RADIUS - 0.3, RADIUS)
    text(paper, (-2.5, -4.5), f"+{LAST_BEARING_DEG}°", halign="right")
    text(paper, (1.9, -3.4), f"–{LAST_BEARING_DEG}°", halign="right")
    _arc(paper, RUN_ON_DEG, HOME_DEG, RED)
    _ray(paper, HOME_DEG, RADIUS, RADIUS + 0.6, RED)
    text(paper, (2.6, -4.7), f"home, –{-HOME_DEG}°")
    for degrees in (-PEG_DEG, PEG_DEG):
        paper.add(elm.Dot(color=RED).at(_at(RADIUS + 0.5, degrees)))
    text(paper, (-0.7, -5.1), f"peg, ±{PEG_DEG}°", halign="right")
    text(paper, (0, -6.2), "seen from above; red: S2 is pressed", halign="center")
    _sensor(paper)
    _side(paper)
    return paper


def _sensor(paper: Drawing) -> None:
    paper += elm.Dot().at((0, 0))
    text(paper, (0.25, -0.4), "axis of the shaft", size=10)
    paper += elm.Rect(corner1=(-1.6, 0.5), corner2=(1.6, 0.9), lw=2, fill=GREY).at((0, 0)).theta(0)
    for left in (-1.3, 0.3):
        paper += elm.Rect(corner1=(left, 0.9), corner2=(left + 1, 1.6), lw=2, fill=GREY).at((0, 0)).theta(0)
    text(paper, (2, 1.1), "HC-SR04", size=10)
    paper += elm.Line(arrow="->").at((0, 2)).to((0, 3.6)).theta(90)
    paper += elm.Arc2(arrow="->", k=-0.3).at((-1.2, -1.3)).to((1.2, -1.3))
    text(paper, (0, -2.6), "bearings rise this way, anticlockwise", size=10, halign="center")


def _side(paper: Drawing) -> None:
    """From the bottom to the top: motor, base, coupling with cam, disk with sensor."""
    boxes = (
        (-2.2, 2.2, FLOOR - 1.6, FLOOR - 0.5, "motor"),
        (-4.0, 4.0, FLOOR - 0.5, FLOOR, "base"),
        (-0.7, 0.7, FLOOR + 0.4, FLOOR + 2.2, ""),
        (-2.0, 2.0, FLOOR + 2.2, FLOOR + 2.7, "coupling"),
        (-2.0, 2.0, FLOOR + 2.9, FLOOR + 3.4, "disk"),
        (-1.2, 1.2, FLOOR + 3.4, FLOOR + 6.2, "HC-SR04"),
        (2.7, 3.7, FLOOR, FLOOR + 1.5, "S2"),
    )
    for left, right, low, top, words in boxes:
        paper += elm.Rect(corner1=(SIDE + left, low), corner2=(SIDE + right, top), lw=2, fill=GREY).at((0, 0)).theta(0)
        text(paper, (SIDE + (left + right) / 2, (low + top) / 2), words, size=10, halign="center")
    cam = ((SIDE + 1.3, FLOOR + 2.2), (SIDE + 1.3, FLOOR + 1.4), (SIDE + 2.5, FLOOR + 1.4), (SIDE + 2.0, FLOOR + 2.2))
    for start, end in pairwise(cam):
        paper.add(elm.Line(color=RED, lw=3).at(start).to(end))
    paper.add(elm.Line(lw=2).at((SIDE + 2.7, FLOOR + 0.9)).to((SIDE + 2.3, FLOOR + 1.6)))  # the lever
    text(paper, (SIDE + 2.4, FLOOR + 2.5), "cam below it", size=10)
    text(paper, (SIDE + 2.4, FLOOR + 3.15), "disk turns: slots", size=10)
    text(paper, (SIDE, FLOOR - 2.2), "seen from the side", halign="center")


def _at(radius: float, degrees: float) -> Point:
    """Forward is up the page, and bearings rise anticlockwise."""
    return -radius * sin(radians(degrees)), radius * cos(radians(degrees))


def _arc(paper: Drawing, first: int, last: int, color: str) -> None:
    chords = abs(last - first) // 5
    points = [_at(RADIUS, first + (last - first) * number / chords) for number in range(chords + 1)]
    for start, end in pairwise(points):
        paper.add(elm.Line(color=color, lw=3).at(start).to(end))


def _ray(paper: Drawing, degrees: float, inner: float, outer: float, color: str = "black") -> None:
    paper.add(elm.Line(color=color).at(_at(inner, degrees)).to(_at(outer, degrees)))


def _mark(paper: Drawing, degrees: float, radius: float, words: str) -> None:
    text(paper, _at(radius, degrees), words, halign="center")
