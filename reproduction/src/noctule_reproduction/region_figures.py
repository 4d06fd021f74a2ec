"""Figures 5-7: the contact regions of readings of one wall and of one cylinder, and what their fusion makes of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from noctule_mapper.config import GridConfig, MapperConfig
from noctule_mapper.contacts.contact_book import ContactBook
from noctule_mapper.contacts.voting import Contacts, Kind
from noctule_mapper.fusion.sensor_model import arc_masses
from noctule_mapper.grid.grid import Grid, GridTile
from noctule_mapper.grid.regions import contact_regions, epsilon_m
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes, echoes_of
from noctule_mapper.readings.sweep import SweepReadings
from noctule_reproduction import raster
from noctule_reproduction.drawing import CENTRE_M, CORNERS_M, RADIUS_M
from noctule_reproduction.raster import Raster
from noctule_reproduction.style import FAINT, INK, MUTED, RELIABILITY, WALL, plan, sheet, styled

CELL_M = 0.002
_WALL_WINDOW_M = (0.45, 0.98), (1.5, 1.62)
_CYLINDER_WINDOW_M = 0.55  # to each side of its centre
_ZOOM_M = (0.035, 0.022)  # half width and height of what the insets show
_LOWER_LEFT, _MIDDLE = (0.03, 0.08, 0.42, 0.42), (0.3, 0.36, 0.4, 0.25)
_CONFIG = MapperConfig()


@dataclass(frozen=True)
class Touched:
    """Readings of one reflector, arrays (n,), and rasters of m(occupied) about it.

    ``arcs``: the highest that any reading's whole arc gives a cell, Eq. 6; ``regions``: that any reading's contact
    region gives; ``fused``: all contact regions by PCR6+. ``surface_m``, (k, 2), is the reflector itself.
    """

    x_m: np.ndarray
    y_m: np.ndarray
    range_m: np.ndarray
    direction_rad: np.ndarray
    arcs: Raster
    regions: Raster
    fused: Raster
    surface_m: np.ndarray


def matched(sweeps: Sequence[SweepReadings]) -> tuple[Echoes, Contacts]:
    """The echoes of a survey and their contacts, as the mapper finds them."""
    book = ContactBook(_CONFIG.contacts)
    for number, sweep in enumerate(sweeps):
        echoes = echoes_of(sweep, number, _CONFIG.noise.assumed_sigma_m)
        book.add((sweep.unit, number), sweep.x_m, sweep.y_m, echoes)
    return book.echoes(), book.contacts()


def touched(echoes: Echoes, found: Contacts, kind: Kind, surface_m: np.ndarray, canvas: Raster) -> Touched:
    """What the readings with a contact of ``kind`` on the canvas and within 3 cm of ``surface_m`` say of it."""
    x = echoes.x_m + echoes.range_m * np.cos(found.direction_rad)
    y = echoes.y_m + echoes.range_m * np.sin(found.direction_rad)
    left, right, bottom, top = canvas.extent
    near = np.hypot(x[:, None] - surface_m[:, 0], y[:, None] - surface_m[:, 1]).min(axis=1) < 0.03
    chosen = np.nonzero((found.kind == kind) & near & (x > left) & (x < right) & (y > bottom) & (y < top))[0]
    echoes, found = echoes.take(chosen), found.take(chosen)
    grid_config = _CONFIG.grid.model_copy(update={"cell_m": canvas.cell_m})
    eps = epsilon_m(echoes.sigma_m, grid_config)
    return Touched(
        echoes.x_m,
        echoes.y_m,
        echoes.range_m,
        found.direction_rad,
        arcs=_arcs(echoes, eps, canvas),
        regions=_regions(echoes, found, grid_config, canvas),
        fused=raster.tiled(canvas, _fused(echoes, found, grid_config), "occupied"),
        surface_m=surface_m,
    )


def wall_readings(sweeps: Sequence[SweepReadings]) -> Touched:
    """The readings of part of wall 1 of the paper's room."""
    (x_a, y_a), (x_b, y_b) = CORNERS_M[0], CORNERS_M[1]
    along = np.linspace(0, 1, 1000)
    surface_m = np.stack([x_a + (x_b - x_a) * along, y_a + (y_b - y_a) * along], axis=1)
    return touched(*matched(sweeps), Kind.WALL, surface_m, raster.blank(*_WALL_WINDOW_M, CELL_M))


def cylinder_readings(sweeps: Sequence[SweepReadings]) -> Touched:
    """The readings of the cylinder F."""
    turn = np.linspace(0, 2 * np.pi, 1000)
    surface_m = np.stack([CENTRE_M[0] + RADIUS_M * np.cos(turn), CENTRE_M[1] + RADIUS_M * np.sin(turn)], axis=1)
    low_m, high_m = ((CENTRE_M[0] + off, CENTRE_M[1] + off) for off in (-_CYLINDER_WINDOW_M, _CYLINDER_WINDOW_M))
    return touched(*matched(sweeps), Kind.CYLINDER, surface_m, raster.blank(low_m, high_m, CELL_M))


@styled
def figure_5(wall: Touched, note: str) -> Figure:
    """(a) The arcs of readings along a wall; (b) each reading's contact region."""
    figure = sheet(7.2, 8.4, note)
    above, below = figure.subplots(2, 1)
    image = _picture(above, wall, wall.arcs, "(a)  Measurement reliability: the arcs overlap")
    _beams(above, wall)
    _picture(below, wall, wall.regions, "(b)  Reliability of the cells of each contact region")
    _zoom(below, wall, wall.regions, _LOWER_LEFT)
    figure.colorbar(image, ax=[above, below], label="$m(O)$", shrink=0.5, pad=0.02)
    return figure


@styled
def figure_6(wall: Touched, note: str) -> Figure:
    """The wall's contact regions fused."""
    figure = sheet(7.2, 4.7, note)
    axes = figure.subplots()
    image = _picture(axes, wall, wall.fused, "Contact regions fused by PCR6+")
    _zoom(axes, wall, wall.fused, _LOWER_LEFT)
    figure.colorbar(image, ax=axes, label="$m(O)$", shrink=0.8, pad=0.02)
    return figure


@styled
def figure_7(cylinder: Touched, note: str) -> Figure:
    """The same three steps for a cylinder."""
    figure = sheet(10.5, 4.3, note)
    panels = figure.subplots(1, 3, sharey=True)
    titles = ("(a)  Measurement reliability", "(b)  Contact regions", "(c)  Fused by PCR6+")
    rasters = (cylinder.arcs, cylinder.regions, cylinder.fused)
    images = [_picture(*each) for each in zip(panels, [cylinder] * 3, rasters, titles, strict=True)]
    _beams(panels[0], cylinder)
    for axes, picture in zip(panels[1:], rasters[1:], strict=True):
        axes.set_ylabel("")
        _zoom(axes, cylinder, picture, _MIDDLE)
    figure.colorbar(images[-1], ax=list(panels), label="$m(O)$", shrink=0.7, pad=0.01)
    return figure


def _arcs(echoes: Echoes, eps_m: np.ndarray, canvas: Raster) -> Raster:
    x, y = canvas.centres
    highest = np.zeros_like(canvas.values)
    for n in range(len(echoes)):
        dx, dy = x - echoes.x_m[n], y - echoes.y_m[n]
        angle = wrapped(np.arctan2(dy, dx) - echoes.axis_rad[n])
        masses = arc_masses(np.hypot(dx, dy), angle, echoes.range_m[n], eps_m[n], 2 * echoes.half_beam_rad[n])
        highest = np.maximum(highest, masses[..., 0])
    return Raster(canvas.column, canvas.row, canvas.cell_m, highest)


def _regions(echoes: Echoes, found: Contacts, config: GridConfig, canvas: Raster) -> Raster:
    """Reading by reading, each on a grid of its own."""
    ones = [np.array([n]) for n in range(len(echoes))]
    tiles = [tile for one in ones for tile in _fused(echoes.take(one), found.take(one), config)]
    return raster.tiled(canvas, tiles, "occupied")


def _fused(echoes: Echoes, found: Contacts, config: GridConfig) -> list[GridTile]:
    grid = Grid(config)
    grid.add(contact_regions(echoes, found, config))
    return grid.tiles()


def _picture(axes: Axes, seen: Touched, picture: Raster, title: str) -> AxesImage:
    plan(axes, title)
    axes.plot(*seen.surface_m.T, color=WALL, linewidth=0.8, linestyle=(0, (4, 3)))
    left, right, bottom, top = picture.extent
    axes.set(xlim=(left, right), ylim=(bottom, top))
    return _image(axes, picture)


def _beams(axes: Axes, seen: Touched) -> None:
    """The sensor's places, and the way of each echo."""
    for x, y, range_m, direction in zip(seen.x_m, seen.y_m, seen.range_m, seen.direction_rad, strict=True):
        ends = [x, x + range_m * np.cos(direction)], [y, y + range_m * np.sin(direction)]
        axes.plot(*ends, color=FAINT, linewidth=0.7, zorder=0.5)
    axes.plot(seen.x_m, seen.y_m, "o", color=INK, markersize=3.5)


def _zoom(axes: Axes, seen: Touched, picture: Raster, bounds: tuple[float, float, float, float]) -> None:
    """The place that most readings touched, enlarged at ``bounds`` of ``axes``."""
    touch_x = seen.x_m + seen.range_m * np.cos(seen.direction_rad)
    touch_y = seen.y_m + seen.range_m * np.sin(seen.direction_rad)
    near = np.hypot(touch_x[:, None] - touch_x, touch_y[:, None] - touch_y) < _ZOOM_M[1]
    middle = near[near.sum(axis=1).argmax()]
    x, y = touch_x[middle].mean(), touch_y[middle].mean()
    inset = axes.inset_axes(bounds)
    _image(inset, picture)
    inset.plot(*seen.surface_m.T, color=WALL, linewidth=0.8, linestyle=(0, (4, 3)))
    inset.set(xlim=(x - _ZOOM_M[0], x + _ZOOM_M[0]), ylim=(y - _ZOOM_M[1], y + _ZOOM_M[1]), xticks=[], yticks=[])
    inset.set_title(f"{200 * _ZOOM_M[0]:.0f} cm across, {middle.sum()} readings", fontsize=7, color=MUTED, pad=3)
    for side in inset.spines.values():
        side.set(visible=True, color=MUTED)
    axes.indicate_inset_zoom(inset, edgecolor=MUTED)


def _image(axes: Axes, picture: Raster) -> AxesImage:
    return axes.imshow(
        picture.values,
        extent=picture.extent,
        origin="lower",
        cmap=RELIABILITY,
        vmin=0,
        vmax=1,
        interpolation="nearest",
        zorder=1,
    )
