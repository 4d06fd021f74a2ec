"""A contour as a drawing, SVG: the echoes that it rests on, where the units stood, and what was found, to scale.

What is drawn is a list of layers, the lowest first; each makes its elements from the contour or from the sweeps.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from noctule.messages_pb2 import Contour
from noctule_mapper.contour import touch_marks
from noctule_mapper.readings.sweep import SweepReadings

NAMESPACE = "http://www.w3.org/2000/svg"
_SIDE_PX = 900.0  # of the longer side
_MARGIN_PX, _FOOT_PX = 40.0, 60.0
_LEAST_SIDE_M = 1.0
_BAR_SHARE = 0.3  # of the width, that the scale bar has at most
_UNITS = ("#2f7d57", "#1f6fb2", "#7a4fd0", "#c2407f", "#a9780f")
_ARROW_PX = 16.0


@dataclass(frozen=True)
class _Sheet:
    """What is to be drawn, and how the site's metres become the sheet's pixels, y downwards."""

    contour: Contour
    sweeps: Sequence[SweepReadings]
    left_m: float
    top_m: float
    px_per_m: float
    width_px: float
    height_px: float

    def at(self, x_m: float, y_m: float) -> tuple[float, float]:
        return _MARGIN_PX + (x_m - self.left_m) * self.px_per_m, _MARGIN_PX + (self.top_m - y_m) * self.px_per_m

    def colour(self, unit: str) -> str:
        units = sorted({sweep.unit for sweep in self.sweeps})
        return _UNITS[units.index(unit) % len(_UNITS)]


def svg(contour: Contour, sweeps: Sequence[SweepReadings]) -> bytes:
    """The drawing of ``contour`` over the ``sweeps`` that it was fitted to, a group for each kind of thing."""
    sheet = _sheet(contour, sweeps)
    size = {"width": f"{sheet.width_px:.0f}", "height": f"{sheet.height_px:.0f}"}
    root = ET.Element(
        "svg",
        size | {"xmlns": NAMESPACE, "viewBox": f"0 0 {size['width']} {size['height']}", "font-family": "sans-serif"},
    )
    ET.SubElement(root, "title").text = f"Contour of {contour.site}" if contour.site else "Contour"
    ET.SubElement(root, "rect", size | {"fill": "white"})
    for name, style, layer in _LAYERS:
        group = ET.SubElement(root, "g", {"id": name, **style})
        group.extend(layer(sheet))
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def _sheet(contour: Contour, sweeps: Sequence[SweepReadings]) -> _Sheet:
    points_m = [np.zeros((0, 2)), *(sweep.echoes_m() for sweep in sweeps)]
    points_m += [np.array([[sweep.x_m, sweep.y_m]]) for sweep in sweeps]
    points_m += [
        np.array([[end.x_m, end.y_m] for wall in contour.walls for end in (wall.start, wall.end)]).reshape(-1, 2)
    ]
    points_m += [np.array(touch_marks.bar_m(touch)) for touch in contour.touches]
    for round_ in contour.cylinders:
        centre, radius_m = np.array([round_.x_m, round_.y_m]), round_.radius_m
        points_m.append(np.array([centre - radius_m, centre + radius_m]))
    all_m = np.concatenate(points_m)
    low_m, high_m = (all_m.min(axis=0), all_m.max(axis=0)) if len(all_m) else (np.zeros(2), np.zeros(2))
    spare_m = np.maximum(_LEAST_SIDE_M - (high_m - low_m), 0) / 2
    low_m, high_m = low_m - spare_m, high_m + spare_m
    px_per_m = _SIDE_PX / float((high_m - low_m).max())
    width_px, height_px = (high_m - low_m) * px_per_m + 2 * _MARGIN_PX
    return _Sheet(contour, sweeps, low_m[0], high_m[1], px_per_m, width_px, height_px + _FOOT_PX)


def _echoes(sheet: _Sheet) -> Iterator[ET.Element]:
    for sweep in sheet.sweeps:
        colour = sheet.colour(sweep.unit)
        for x_m, y_m in sweep.echoes_m():
            yield _circle(*sheet.at(x_m, y_m), 1.6, fill=colour)


def _units(sheet: _Sheet) -> Iterator[ET.Element]:
    """Each place once, with an arrow where the unit looked; its name at the first."""
    named = set()
    for unit, x_m, y_m, heading_rad in dict.fromkeys(
        (sweep.unit, sweep.x_m, sweep.y_m, sweep.heading_rad) for sweep in sheet.sweeps
    ):
        (x, y), colour = sheet.at(x_m, y_m), sheet.colour(unit)
        tip = x + _ARROW_PX * math.cos(heading_rad), y - _ARROW_PX * math.sin(heading_rad)
        yield _circle(x, y, 4.5, fill=colour)
        yield _line((x, y), tip, stroke=colour)
        if unit not in named:
            named.add(unit)
            yield _text(x + 8, y - 8, unit, fill=colour)


def _walls(sheet: _Sheet) -> Iterator[ET.Element]:
    for wall in sheet.contour.walls:
        ends = sheet.at(wall.start.x_m, wall.start.y_m), sheet.at(wall.end.x_m, wall.end.y_m)
        yield _line(*ends)


def _lengths(sheet: _Sheet) -> Iterator[ET.Element]:
    for wall in sheet.contour.walls:
        length_m = math.hypot(wall.end.x_m - wall.start.x_m, wall.end.y_m - wall.start.y_m)
        x, y = sheet.at((wall.start.x_m + wall.end.x_m) / 2, (wall.start.y_m + wall.end.y_m) / 2)
        yield _text(x + 6, y - 6, f"{length_m:.2f} m")
    for cylinder in sheet.contour.cylinders:
        x, y = sheet.at(cylinder.x_m, cylinder.y_m)
        yield _text(x, y + 4, f"r {cylinder.radius_m:.2f} m", **{"text-anchor": "middle"})


def _corners(sheet: _Sheet) -> Iterator[ET.Element]:
    for corner in sheet.contour.corners:
        yield _circle(*sheet.at(corner.x_m, corner.y_m), 5)


def _cylinders(sheet: _Sheet) -> Iterator[ET.Element]:
    for cylinder in sheet.contour.cylinders:
        yield _circle(*sheet.at(cylinder.x_m, cylinder.y_m), cylinder.radius_m * sheet.px_per_m)


def _touches(sheet: _Sheet) -> Iterator[ET.Element]:
    for touch in sheet.contour.touches:
        start, end = (sheet.at(*point) for point in touch_marks.bar_m(touch))
        yield _line(start, end)
        yield _text(end[0] + 6, end[1] - 6, touch_marks.label(touch), fill="#7a4fd0")


def _scale(sheet: _Sheet) -> Iterator[ET.Element]:
    most_m = _BAR_SHARE * (sheet.width_px - 2 * _MARGIN_PX) / sheet.px_per_m
    decade_m = 10.0 ** math.floor(math.log10(most_m))
    bar_m = max(step * decade_m for step in (1, 2, 5) if step * decade_m <= most_m)
    x, y, length = _MARGIN_PX, sheet.height_px - 24, bar_m * sheet.px_per_m
    yield _line((x, y), (x + length, y))
    yield _line((x, y - 5), (x, y + 5))
    yield _line((x + length, y - 5), (x + length, y + 5))
    yield _text(x + length + 10, y + 4, f"{bar_m:g} m")


_Layer = Callable[[_Sheet], Iterator[ET.Element]]
_LAYERS: tuple[tuple[str, dict[str, str], _Layer], ...] = (
    ("echoes", {"fill-opacity": "0.45"}, _echoes),
    ("cylinders", {"fill": "#ff8c42", "fill-opacity": "0.15", "stroke": "#d96a1f", "stroke-width": "3"}, _cylinders),
    ("walls", {"stroke": "#1b1f24", "stroke-width": "4", "stroke-linecap": "round"}, _walls),
    ("touches", {"stroke": "#7a4fd0", "stroke-width": "3", "font-size": "11"}, _touches),
    ("corners", {"fill": "#1b1f24"}, _corners),
    ("units", {"stroke-width": "2.5", "font-size": "13"}, _units),
    ("lengths", {"fill": "#1b1f24", "font-size": "13"}, _lengths),
    ("scale", {"stroke": "#1b1f24", "stroke-width": "2", "font-size": "13"}, _scale),
)


def _circle(x: float, y: float, radius: float, **attributes: str) -> ET.Element:
    return ET.Element("circle", {"cx": f"{x:.1f}", "cy": f"{y:.1f}", "r": f"{radius:.1f}", **attributes})


def _line(start: tuple[float, float], end: tuple[float, float], **attributes: str) -> ET.Element:
    (x1, y1), (x2, y2) = start, end
    return ET.Element(
        "line", {"x1": f"{x1:.1f}", "y1": f"{y1:.1f}", "x2": f"{x2:.1f}", "y2": f"{y2:.1f}", **attributes}
    )


def _text(x: float, y: float, text: str, **attributes: str) -> ET.Element:
    element = ET.Element("text", {"x": f"{x:.1f}", "y": f"{y:.1f}", "stroke": "none", **attributes})
    element.text = text
    return element
