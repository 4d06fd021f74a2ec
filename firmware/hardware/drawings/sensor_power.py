"""The optional part that cuts the sensor's 5 V while its pin is low."""

from schemdraw import Drawing
from schemdraw import elements as elm
from sheet import dot, ground, part, sheet, star, supply, text, wire

PIN_HEIGHT, RAIL = 0.0, 6.0
BASE = 8.0  # of the upper transistor, from the left
SENSOR = 14.0


def drawing(pins: dict[str, str]) -> Drawing:
    paper = sheet()
    part(paper, -5.5, -1, "C8051F340 board", {}, {f"{pins['SENSOR_POWER']}  SENSOR_POWER": PIN_HEIGHT}, low=-1)
    wire(paper, (-1, PIN_HEIGHT), (1.5, PIN_HEIGHT))
    dot(paper, (1.5, PIN_HEIGHT))
    paper.add(elm.Resistor().at((1.5, 2.5)).to((1.5, PIN_HEIGHT)).label("R10  10 kΩ", "top"))
    supply(paper, (1.5, 2.5), "3.3 V")
    paper.add(elm.Resistor().at((1.5, PIN_HEIGHT)).to((4, PIN_HEIGHT)).label("R11  10 kΩ", "bottom"))
    lower = paper.add(elm.BjtNpn(circle=True).at((4, PIN_HEIGHT)).anchor("base").theta(0))
    text(paper, (lower.emitter[0] + 0.6, PIN_HEIGHT), "Q1  BC547B")
    ground(paper, tuple(lower.emitter))
    drive = (lower.collector[0], 3.2)
    wire(paper, tuple(lower.collector), drive)
    upper = paper.add(elm.BjtPnp(circle=True).at((BASE, 3.2)).anchor("base").theta(0))
    text(paper, (upper.emitter[0] + 0.6, 3.2), "Q2  BC327")
    paper.add(elm.Resistor().at(drive).to((BASE - 1, 3.2)).label("R12  2.2 kΩ", "bottom"))
    wire(paper, (BASE - 1, 3.2), (BASE, 3.2))
    dot(paper, (BASE - 1, 3.2))
    paper.add(elm.Resistor().at((BASE - 1, RAIL)).to((BASE - 1, 3.2)).label("R13  10 kΩ", "top"))
    wire(paper, (BASE - 1, RAIL), (upper.emitter[0], RAIL), tuple(upper.emitter))
    dot(paper, (upper.emitter[0], RAIL))
    supply(paper, (upper.emitter[0], RAIL), "5 V")
    switched = (upper.collector[0], 0.8)
    wire(paper, tuple(upper.collector), switched, (SENSOR, 0.8))
    part(paper, SENSOR, SENSOR + 3.5, "HC-SR04", {"VCC": 0.8, "Gnd": -2}, {}, low=-2.8)
    low = -1.4
    for left, element in (
        (switched[0] + 0.6, elm.Resistor().label("R14  1 kΩ", "bottom")),
        (switched[0] + 3.2, elm.Capacitor().label("C4, C5", "bottom")),
    ):
        dot(paper, (left, 0.8))
        paper.add(element.at((left, 0.8)).to((left, low)))
        star(paper, (left, low))
    wire(paper, (SENSOR, -2), (SENSOR - 0.8, -2))
    star(paper, (SENSOR - 0.8, -2))
    return paper
