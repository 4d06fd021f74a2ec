"""The hardware pages agree with the firmware, and their drawings with their tables."""

import html
import re
import subprocess
import sys
from pathlib import Path

import pytest
from docs.blocks import blocks
from system.processes import ROOT

from noctule import site

PAGES = ROOT / "firmware/hardware"
DRAWN = ("wiring", "power", "sensor-power", "mount")
UART0 = {"TX": "P0.4", "RX": "P0.5"}  # fixed by the chip: data sheet C8051F34x, "Port Input/Output", crossbar
VREF = {"VREF": "P1.5"}  # the same, "Voltage Reference"
COILS = 4  # COIL_1 on the port's lowest bit
UNITS = "Ω|kΩ|nF|µF"


def pin_table() -> dict[str, tuple[str, str]]:
    """Pin and direction of each signal."""
    rows = re.findall(r"^\| (P\d\.\d) \| (\w+) \| ([^|]+) \|", (PAGES / "wiring.md").read_text(), re.MULTILINE)
    return {signal: (pin, direction.strip()) for pin, signal, direction in rows}


def of_the_firmware() -> dict[str, str]:
    """The pin of each signal, by hal/board.h."""
    board = (ROOT / "firmware/hal/board.h").read_text()
    named = {signal: f"P{port}.{bit}" for signal, port, bit in re.findall(r"#define PIN_(\w+) P(\d)_(\d)", board)}
    (port,) = re.findall(r"#define PORT_COILS P(\d)", board)
    return named | {f"COIL_{bit + 1}": f"P{port}.{bit}" for bit in range(COILS)} | UART0 | VREF


def register(name: str, at_reset: int) -> int:
    """What hal/pins.c writes to a register, or what it holds after a reset."""
    written = re.findall(rf"^ +{name} = 0x(\w\w);", (ROOT / "firmware/hal/pins.c").read_text(), re.MULTILINE)
    return int(written[0], 16) if written else at_reset


def direction(pin: str, signal: str) -> str:
    port, bit = pin[1], 1 << int(pin[3])
    if not register(f"P{port}MDIN", at_reset=0xFF) & bit:
        return "analog"
    if register(f"P{port}MDOUT", at_reset=0x00) & bit:
        return "out, push-pull"
    return "out, open drain" if signal == "SENSOR_POWER" else "in"


def drawn_texts(name: str) -> list[str]:
    return [html.unescape(text) for text in re.findall(r">([^<>]+)</t", (PAGES / f"{name}.svg").read_text())]


def values_drawn() -> dict[str, str]:
    found: dict[str, str] = {}
    for name in DRAWN:
        for text in drawn_texts(name):
            found |= dict(re.findall(rf"\b([RC]\d+) +([\d.]+ (?:{UNITS}))", text))
            if several := re.match(rf"R(\d+) to R(\d+): ([\d.]+ (?:{UNITS})) each", text):
                found |= {f"R{number}": several[3] for number in range(int(several[1]), int(several[2]) + 1)}
    return found


def values_ordered() -> dict[str, str]:
    rows = re.findall(
        rf"^\| ((?:[RC]\d+(?:, )?)+) \| [a-z ]+ ([\d.]+ (?:{UNITS}))", (PAGES / "parts.md").read_text(), re.MULTILINE
    )
    return {part: value for parts, value in rows for part in parts.split(", ")}


def test_the_pins_of_the_wiring_page_are_the_firmwares() -> None:
    assert {signal: pin for signal, (pin, _) in pin_table().items()} == of_the_firmware()


def test_their_directions_are_what_the_firmware_sets() -> None:
    expected = {signal: direction(pin, signal) for signal, (pin, _) in pin_table().items()}
    assert {signal: told.removesuffix(", weak pull-up") for signal, (_, told) in pin_table().items()} == expected


def test_each_pin_is_drawn_with_its_signal() -> None:
    texts = {" ".join(text.split()) for name in DRAWN for text in drawn_texts(name)}
    assert {f"{pin} {signal}" for signal, (pin, _) in pin_table().items()} <= texts


def test_the_parts_list_has_each_part_drawn_with_its_value() -> None:
    assert len(values_drawn()) >= 20
    assert values_drawn() == values_ordered()


def named(text: str) -> set[str]:
    """The parts that a text names, R6 to R9 being four."""
    ranges = re.findall(r"\b([RC])(\d+) to \1(\d+)\b", text)
    between = {f"{kind}{number}" for kind, first, last in ranges for number in range(int(first), int(last) + 1)}
    return set(re.findall(r"\b[RCQDSJ]\d+\b", text)) | between


def test_each_part_is_tried_in_a_step_of_the_first_power_up() -> None:
    steps = re.findall(r"^\| \d+ \| ([^|]+) \|", (PAGES / "power-up.md").read_text(), re.MULTILINE)
    rows = re.findall(r"^\| ([^|]+) \|", (PAGES / "parts.md").read_text(), re.MULTILINE)
    ordered = {part for row in rows for part in named(row)}
    assert len(ordered) >= 25
    assert ordered <= set().union(*map(named, steps))


def test_the_pages_agree_on_what_the_motor_draws() -> None:
    pages = [(PAGES / f"{name}.md").read_text().replace("*", "") for name in ("wiring", "power-up", "production")]
    ranges = [re.findall(r"(\d+) to (\d+) mA more", page) for page in pages]
    assert all(ranges)
    ((_, most),) = {one for found in ranges for one in found}
    assert f"up to {most} mA" in drawn_texts("power")


def test_what_is_calibrated_is_stored_before_the_section_ends() -> None:
    sections = (PAGES / "commissioning.md").read_text().split("\n## ")
    changed = [part for part in sections if re.search(r"^ .* (calibrate|trim_temperature) ", part, re.MULTILINE)]
    assert len(changed) == 4
    for section in changed:
        *_, last = re.findall(r"^ .* u7 (calibrate|trim_temperature|store)\b", section, re.MULTILINE)
        assert last == "store", section.splitlines()[0]


def test_the_drawings_are_what_their_sources_draw(tmp_path: Path) -> None:
    subprocess.run([sys.executable, PAGES / "drawings/draw.py", tmp_path], check=True)
    for name in DRAWN:
        assert (tmp_path / f"{name}.svg").read_text() == (PAGES / f"{name}.svg").read_text(), "type: make hardware"


def test_the_site_file_of_the_bench_is_one(tmp_path: Path) -> None:
    (text,) = [block.text for block in blocks(PAGES / "power-up.md") if block.text.startswith("site =")]
    (tmp_path / "attic.toml").write_text(text)
    assert site.load(tmp_path / "attic.toml").unit("u7").serial == 7


@pytest.mark.parametrize(
    ("page", "sentence", "source", "constant"),
    [
        ("mount.md", r"never looks beyond (\d+) degrees", "core/plan.c", r"OUTERMOST DEGREES\((\d+)\)"),
        ("mount.md", r"clockwise at (\d+) half steps/s", "homing.c", r"TOP_SPEED (\d+)"),
        ("unproven.md", r"against a stop, (\d+) half steps/s", "homing.c", r"TOP_SPEED_AGAINST_STOP (\d+)"),
        ("commissioning.md", r"It takes -180 to -(\d+)", "core/calibration.c", r"<= BELOW_FORWARD\((\d+)\)"),
        ("commissioning.md", r"Over (\d+) \(", "core/calibration.c", r"MOST_BACKLASH (\d+)"),
        ("unproven.md", r"3.3 V is enough, (\d+) µs", "echo.c", r"TRIGGER_TICKS \((\d+) \* TICKS_PER_US\)"),
        ("wiring.md", r"gives the sensor (\d+) ms to start", "echo.c", r"START_TICKS \((\d+) \* TICKS_PER_MS\)"),
    ],
)
def test_a_number_of_the_pages_is_the_firmwares(page: str, sentence: str, source: str, constant: str) -> None:
    text = " ".join((PAGES / page).read_text().split())
    assert re.findall(sentence, text) == re.findall(constant, (ROOT / "firmware/src" / source).read_text())[:1] != []
