"""Where the current goes: one 5 V supply, a wire of its own to each consumer, and back."""

from schemdraw import Drawing
from schemdraw import elements as elm
from sheet import dot, part, sheet, text, wire

PLUS, MINUS = 2.5, 4.0  # the two star points, from the left
PLUS_HEIGHT, MINUS_HEIGHT = 6.0, 4.0
BRANCH = 11.0


def drawing() -> Drawing:
    paper = sheet()
    part(paper, -4, 0, "5 V supply, 2 A", {}, {"+ 5 V": PLUS_HEIGHT, "– GND": MINUS_HEIGHT}, low=3)
    wire(paper, (0, PLUS_HEIGHT), (PLUS, PLUS_HEIGHT))
    wire(paper, (0, MINUS_HEIGHT), (MINUS, MINUS_HEIGHT))
    branches = (
        (10.5, "ULN2003 board", "+", "–", "C6  470 µF", "up to 250 mA"),
        (PLUS_HEIGHT, "HC-SR04", "VCC", "Gnd", "C4  10 µF, C5  100 nF", "15 mA"),
        (1.5, "C8051F340 board", "5 V in", "GND", "", "up to 100 mA"),
    )
    for height, title, plus, minus, capacitor, current in branches:
        part(paper, BRANCH, BRANCH + 5, title, {plus: height, minus: height - 2}, {}, low=height - 2.8)
        text(paper, (BRANCH + 4.8, height - 1), current, halign="right")
        wire(paper, (PLUS, PLUS_HEIGHT), (PLUS, height), (BRANCH, height))
        wire(paper, (MINUS, MINUS_HEIGHT), (MINUS, height - 2), (BRANCH, height - 2))
        if capacitor:
            at = BRANCH - 1
            dot(paper, (at, height))
            dot(paper, (at, height - 2))
            paper.add(elm.Capacitor().at((at, height)).to((at, height - 2)).label(capacitor, "top"))
    part(paper, BRANCH, BRANCH + 5, "USB serial adapter", {"GND": -4}, {}, low=-4.8)
    wire(paper, (MINUS, MINUS_HEIGHT), (MINUS, -4), (BRANCH, -4))
    text(paper, (BRANCH - 0.3, -4.5), "its VCC stays open", halign="right", size=10)
    dot(paper, (PLUS, PLUS_HEIGHT))
    dot(paper, (MINUS, MINUS_HEIGHT))
    text(paper, (PLUS - 0.3, 6.6), "5 V star", halign="right")
    text(paper, (MINUS + 0.2, 3.4), "ground star")
    return paper
