"""Draws the pictures of the hardware pages, as SVG beside the pages: make hardware.

python firmware/hardware/drawings/draw.py [FOLDER]
"""

import re
import sys
from pathlib import Path

import mount
import power
import schemdraw
import sensor_power
import wiring
from pin_table import pins

PAGES = Path(__file__).parents[1]


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else PAGES
    schemdraw.use("svg")
    wired = pins(PAGES / "wiring.md")
    drawings = {
        "wiring": wiring.drawing(wired),
        "sensor-power": sensor_power.drawing(wired),
        "power": power.drawing(),
        "mount": mount.drawing(),
    }
    for name, drawing in drawings.items():
        (folder / f"{name}.svg").write_text(_rounded(drawing.get_imagedata("svg").decode()) + "\n")


def _rounded(svg: str) -> str:
    """A hundredth of a pixel is enough, and the same on every machine."""
    return re.sub(r"-?\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}", svg)


if __name__ == "__main__":
    main()
