"""Everything that hangs on the chip, wire by wire, but for what cuts the sensor's power."""

from schemdraw import Drawing
from schemdraw import elements as elm
from sheet import dot, ground, part, sheet, star, supply, text, wire

LEFT, RIGHT = 0.0, 6.0  # the chip's board
PLUG = -6.5  # what is plugged in on its left
SENSOR = 13.0  # and on its right


def drawing(pins: dict[str, str]) -> Drawing:
    paper = sheet()
    heights_left = {"TX": 18.5, "RX": 17, "RESET": 12.5, "BUTTON": 9.8, "LED": 7.6, "HOME": 3.4, "VREF": 0}
    heights_right = {
        "TRIGGER": 17,
        "ECHO": 15,
        "SENSOR_POWER": 11.5,
        "COIL_1": 8,
        "COIL_2": 7,
        "COIL_3": 6,
        "COIL_4": 5,
    }
    part(
        paper, LEFT, RIGHT, "U1  C8051F340 board",
        {_name(pins, signal): height for signal, height in heights_left.items()} | {"GND": -3.2},
        {_name(pins, signal): height for signal, height in heights_right.items()} | {"3.3 V": 0, "GND": -2},
        low=-4,
    )  # fmt: skip
    _serial(paper, heights_left["TX"], heights_left["RX"])
    _reset(paper, heights_left["RESET"])
    _button(paper, heights_left["BUTTON"])
    _led(paper, heights_left["LED"])
    _home(paper, heights_left["HOME"])
    _reference(paper, heights_left["VREF"])
    _sensor(paper, heights_right["TRIGGER"], heights_right["ECHO"])
    _motor(paper, [heights_right[f"COIL_{number}"] for number in (1, 2, 3, 4)])
    _rest(paper, heights_right["SENSOR_POWER"])
    return paper


def _name(pins: dict[str, str], signal: str) -> str:
    return f"{pins[signal]}  {signal}" if signal in pins else "/RST"


def _serial(paper: Drawing, tx: float, rx: float) -> None:
    part(paper, PLUG - 4.5, PLUG, "USB serial adapter, 3.3 V", {}, {"RXD": tx, "TXD": rx, "GND": 15.5}, low=14.8)
    wire(paper, (PLUG, tx), (LEFT, tx))
    paper.add(elm.Resistor().at((PLUG + 2, rx)).to((LEFT - 2, rx)).label("R1  1 kΩ", "bottom"))
    wire(paper, (PLUG, rx), (PLUG + 2, rx))
    wire(paper, (LEFT - 2, rx), (LEFT, rx))
    wire(paper, (PLUG, 15.5), (PLUG + 1, 15.5))
    star(paper, (PLUG + 1, 15.5))


def _reset(paper: Drawing, height: float) -> None:
    part(paper, PLUG + 0.5, PLUG + 3.2, "", {}, {"/RST": height}, low=height - 1.5)
    text(paper, (PLUG + 0.7, height + 0.55), "U2 supervisor", size=10)
    text(paper, (PLUG + 1.2, height - 0.75), "2.9 V", size=10)
    text(paper, (PLUG + 0.6, height + 0.2), "2", size=9)
    text(paper, (PLUG + 0.6, height - 1.0), "3", size=9)
    text(paper, (PLUG + 3.3, height + 0.25), "1", size=9)
    wire(paper, (PLUG + 3.2, height), (LEFT - 2.4, height))
    paper.add(elm.Line().at((LEFT - 2.4, height)).to((LEFT - 1, height)).dot(open=True).idot(open=True).label("J1"))
    wire(paper, (LEFT - 1, height), (LEFT, height))
    upper, lower, at = height + 0.4, height - 1.2, PLUG - 0.6
    wire(paper, (PLUG + 0.5, upper), (at, upper))
    supply(paper, (at, upper), "3.3 V")
    paper.add(elm.Capacitor().at((at, upper)).to((at, lower)).label("C7  100 nF", "top"))
    dot(paper, (at, upper))
    dot(paper, (at, lower))
    wire(paper, (PLUG + 0.5, lower), (at, lower))
    ground(paper, (at, lower))


def _button(paper: Drawing, height: float) -> None:
    paper.add(elm.Button().at((LEFT - 2, height)).to((LEFT - 5, height)).label("S1 button"))
    wire(paper, (LEFT, height), (LEFT - 2, height))
    ground(paper, (LEFT - 5, height))


def _led(paper: Drawing, height: float) -> None:
    paper.add(elm.Resistor().at((LEFT - 1, height)).to((LEFT - 3, height)).label("R2  470 Ω", "top"))
    paper.add(elm.LED().at((LEFT - 3, height)).to((LEFT - 5, height)).label("D1", "bottom"))
    wire(paper, (LEFT, height), (LEFT - 1, height))
    ground(paper, (LEFT - 5, height))


def _home(paper: Drawing, height: float) -> None:
    wire(paper, (LEFT, height), (LEFT - 7, height))
    paper.add(elm.Resistor().at((LEFT - 3, height + 2)).to((LEFT - 3, height)).label("R3  2.2 kΩ", "bottom"))
    supply(paper, (LEFT - 3, height + 2), "3.3 V")
    dot(paper, (LEFT - 3, height))
    paper.add(elm.Capacitor().at((LEFT - 4, height)).to((LEFT - 4, height - 2)).label("C1  220 nF", "bottom"))
    dot(paper, (LEFT - 4, height))
    ground(paper, (LEFT - 4, height - 2))
    paper.add(elm.Switch(nc=True).at((LEFT - 7, height)).to((LEFT - 7, height - 2)).label("S2 (NC)", "top"))
    ground(paper, (LEFT - 7, height - 2))


def _reference(paper: Drawing, height: float) -> None:
    wire(paper, (LEFT, height), (LEFT - 6.5, height))
    for left, value in ((LEFT - 3, "C2  4.7 µF"), (LEFT - 6.5, "C3  100 nF")):
        paper.add(elm.Capacitor().at((left, height)).to((left, height - 2)).label(value, "bottom"))
        ground(paper, (left, height - 2))
    dot(paper, (LEFT - 3, height))
    wire(paper, (LEFT, -3.2), (LEFT - 1, -3.2))
    ground(paper, (LEFT - 1, -3.2))


def _sensor(paper: Drawing, trigger: float, echo: float) -> None:
    part(paper, SENSOR, SENSOR + 4, "HC-SR04", {"VCC": 18.5, "Trig": trigger, "Echo": echo, "Gnd": 13}, {}, low=12.2)
    wire(paper, (RIGHT, trigger), (SENSOR, trigger))
    paper.add(elm.Resistor().at((SENSOR - 0.8, echo)).to((SENSOR - 3, echo)).label("R4  1 kΩ", "top"))
    wire(paper, (SENSOR, echo), (SENSOR - 0.8, echo))
    wire(paper, (RIGHT, echo), (SENSOR - 3, echo))
    paper.add(elm.Resistor().at((RIGHT + 3, echo)).to((RIGHT + 3, echo - 2)).label("R5  2 kΩ", "bottom"))
    dot(paper, (RIGHT + 3, echo))
    ground(paper, (RIGHT + 3, echo - 2))
    wire(paper, (SENSOR, 18.5), (SENSOR - 4, 18.5))
    supply(paper, (SENSOR - 4, 18.5), "5 V")
    text(paper, (SENSOR - 3.6, 18.9), "or from Q2, if fitted", size=10)
    wire(paper, (SENSOR, 13), (SENSOR - 1, 13))
    star(paper, (SENSOR - 1, 13))


def _motor(paper: Drawing, heights: list[float]) -> None:
    inputs = {f"IN{number}": height for number, height in enumerate(heights, start=1)}
    part(paper, SENSOR, SENSOR + 4, "ULN2003 board", inputs | {"+": 3.5, "–": 2.3}, {}, low=1.5)
    text(paper, (SENSOR + 1.6, 7), "plug of the")
    text(paper, (SENSOR + 1.6, 6.3), "28BYJ-48")
    bus = 2.0
    for number, height in enumerate(heights):
        wire(paper, (RIGHT, height), (SENSOR, height))
        at = RIGHT + 1.2 + 1.2 * number
        wire(paper, (at, height), (at, 4.2))
        paper.add(elm.Resistor().at((at, 4.2)).to((at, bus)))
        dot(paper, (at, height))
    wire(paper, (RIGHT + 1.2, bus), (RIGHT + 4.8, bus))
    ground(paper, (RIGHT + 3, bus))
    text(paper, (RIGHT + 3.4, 1.2), "R6 to R9: 10 kΩ each", size=10)
    wire(paper, (SENSOR, 3.5), (SENSOR - 1.2, 3.5))
    supply(paper, (SENSOR - 1.2, 3.5), "5 V")
    wire(paper, (SENSOR, 2.3), (SENSOR - 0.6, 2.3))
    star(paper, (SENSOR - 0.6, 2.3))


def _rest(paper: Drawing, sensor_power: float) -> None:
    wire(paper, (RIGHT, sensor_power), (RIGHT + 1, sensor_power))
    text(paper, (RIGHT + 1.2, sensor_power), "left open, or to R10 and R11", size=10)
    wire(paper, (RIGHT, 0), (RIGHT + 1, 0))
    text(paper, (RIGHT + 1.2, 0), "to R3, U2 (and R10)", size=10)
    wire(paper, (RIGHT, -2), (RIGHT + 1, -2))
    star(paper, (RIGHT + 1, -2))
    text(paper, (RIGHT + 1.8, -2.2), "one wire to the ground star", size=10)
    ground(paper, (RIGHT + 1, -4))
    text(paper, (RIGHT + 1.8, -4.2), "GND at the chip's board: no motor current", size=10)
    star(paper, (RIGHT + 1, -5))
    text(paper, (RIGHT + 1.8, -5.2), "the ground star, at the supply: power.svg", size=10)
