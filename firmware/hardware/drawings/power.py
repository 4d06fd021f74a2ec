"""Where the current goes: one 5 V supply, a wire of its own to each consumer, and back; and a second for the chip."""

from schemdraw import Drawing
from schemdraw import elements as elm
from sheet import Point, dot, part, sheet, text, wire

PLUS, MINUS = 2.5, 4.0  # the two star points, from the left
PLUS_HEIGHT, MINUS_HEIGHT = 6.0, 4.0
BRANCH = 11.0
ADAPTER, OWN = -5.0, -9.5


def drawing() -> Drawing:
    paper = sheet()
    part(paper, -4, 0, "5 V supply, 2 A", {}, {"+ 5 V": PLUS_HEIGHT, "– GND": MINUS_HEIGHT}, low=3)
    wire(paper, (0, PLUS_HEIGHT), (PLUS, PLUS_HEIGHT))
    wire(paper, (0, MINUS_HEIGHT), (MINUS, MINUS_HEIGHT))
    branches = (
        (11.5, "ULN2003 board", "+", "–", ("C6  470 µF",), "up to 250 mA"),
        (PLUS_HEIGHT, "HC-SR04", "VCC", "Gnd", ("C5  100 nF", "C4  10 µF"), "15 mA"),
        (0.5, "U1  C8051F340 board", "5 V in", "GND", ("C8  100 µF",), "up to 100 mA"),
    )
    for height, title, plus, minus, capacitors, current in branches:
        part(paper, BRANCH, BRANCH + 5, title, {plus: height, minus: height - 2}, {}, low=height - 2.8)
        text(paper, (BRANCH + 4.8, height - 1), current, halign="right")
        wire(paper, (PLUS, PLUS_HEIGHT), (PLUS, height), (BRANCH, height))
        wire(paper, (MINUS, MINUS_HEIGHT), (MINUS, height - 2), (BRANCH, height - 2))
        for number, capacitor in enumerate(capacitors):
            _capacitor(paper, (BRANCH - 1 - 3 * number, height), capacitor)
    part(paper, BRANCH, BRANCH + 5, "USB serial adapter", {"GND": ADAPTER}, {}, low=ADAPTER - 0.8)
    wire(paper, (MINUS, MINUS_HEIGHT), (MINUS, ADAPTER), (BRANCH, ADAPTER))
    text(paper, (BRANCH - 0.3, ADAPTER - 0.5), "its VCC stays open", halign="right", size=10)
    _own_adapter(paper)
    for at in ((PLUS, PLUS_HEIGHT), (MINUS, MINUS_HEIGHT), (MINUS, -1.5), (MINUS, ADAPTER)):
        dot(paper, at)
    text(paper, (PLUS - 0.3, 6.6), "5 V star", halign="right")
    text(paper, (MINUS + 0.2, 3.4), "ground star")
    return paper


def _capacitor(paper: Drawing, at: Point, words: str) -> None:
    """From the 5 V of a branch down to its ground; electrolytic ones with their plus."""
    left, height = at
    dot(paper, at)
    dot(paper, (left, height - 2))
    kind = elm.Capacitor if words.endswith("nF") else elm.Capacitor2
    paper.add(kind().at(at).to((left, height - 2)).label(words, "top"))
    if kind is elm.Capacitor2:
        text(paper, (left - 0.6, height - 0.6), "+")


def _own_adapter(paper: Drawing) -> None:
    """The other way to feed the chip's board: without 5 V and C8 there, but with its ground at the star."""
    text(paper, (-4, OWN + 2.3), "or, for U1 alone, in place of its 5 V and C8:", size=11)
    part(paper, -4, 0, "9 V adapter", {}, {"+": OWN, "–": OWN - 1.2}, low=OWN - 2)
    part(paper, BRANCH, BRANCH + 5, "U1  C8051F340-TB", {"P1": OWN, "GND": OWN - 2.4}, {}, low=OWN - 3.2)
    wire(paper, (0, OWN), (BRANCH, OWN))
    wire(paper, (0, OWN - 1.2), (BRANCH, OWN - 1.2))
    text(paper, (BRANCH - 0.3, OWN + 0.4), "by its plug", halign="right", size=10)
    wire(paper, (MINUS, ADAPTER), (MINUS, OWN - 0.2))
    wire(paper, (MINUS, OWN - 0.2), (MINUS, OWN - 2.4), (BRANCH, OWN - 2.4))
