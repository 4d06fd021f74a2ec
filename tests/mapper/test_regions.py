"""What readings say of the grid's cells: free space before the arcs, contact regions on them, and what cells are then
taken for.
"""

import numpy as np
import pytest
from mapper.grid_probe import WIDTH_RAD, arcs, at, beliefs_about, centres, cones
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.config import GridConfig
from noctule_mapper.fusion.sensor_model import (
    arc_beliefs,
    arc_level,
    arc_masses,
    direction_trust,
    free_beliefs,
    free_level,
    free_mass,
    off_arc,
)
from noctule_mapper.grid.grid import CellState, Grid, cell_states
from noctule_mapper.grid.regions import epsilon_m, free_space
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.angles import wrapped

CONFIG = GridConfig()


def test_a_contact_region_is_the_sensor_models_arc_about_its_contact():
    # Twenty contacts all round, apart from one another; each step of trust and of distance is 1/32 wide, so a mass is
    # rounded by 0.9 (1/64 + 1/64) at most.
    for direction in np.linspace(-3, 3, 20):
        line = (0.013, -0.007, 1.3, float(direction), 0.05)
        grid = Grid(CONFIG)
        grid.add(arcs(line))
        for tile in grid.tiles():
            x, y = centres(tile)
            angle = wrapped(np.arctan2(y - line[1], x - line[0]) - direction)
            model = arc_masses(np.hypot(x - line[0], y - line[1]), angle, 1.3, 0.05, 6 * 0.05 / 1.3)
            speaks = model[..., 2] < 1
            np.testing.assert_allclose(tile.occupied, 0.9 * model[..., 0] * speaks, atol=0.03)
            np.testing.assert_allclose(tile.free, 0.9 * model[..., 1] * speaks, atol=0.03)
            assert not tile.occupied[~speaks].any()


def test_a_cone_is_the_sensor_models_free_space():
    # Sectors and levels are an eighth of the half beam wide, each rounds trust by a 16th at most; Eq. 7 corrected.
    reach_m = 1.3
    for axis in np.linspace(-3, 3, 20):
        grid = Grid(CONFIG)
        grid.add_free(cones((10, -5, float(axis), reach_m / CONFIG.cell_m)))
        for tile in grid.tiles():
            x, y = centres(tile)
            dx, dy = x - 10.5 * CONFIG.cell_m, y + 4.5 * CONFIG.cell_m
            away = np.hypot(dx, dy)
            model = CONFIG.most_free * free_mass(away, wrapped(np.arctan2(dy, dx) - axis), reach_m, 0.0, WIDTH_RAD)
            sure = (away > CONFIG.cell_m / 2) & (np.abs(away - reach_m) > 1e-9)  # elsewhere rounding decides
            np.testing.assert_allclose(tile.free[sure], model[sure], atol=CONFIG.most_free / 8 + 1e-6)
            assert not tile.occupied.any()


@pytest.mark.parametrize("width_deg", [180, 127, 22.5, 20, 0.5])
def test_the_compiled_kernel_says_of_every_cell_of_a_cone_what_the_sensor_models_table_says(width_deg):
    # As in module grid: sixteen sectors to a beam or up to 32, in all a power of two; a cell has the trust of its
    # sector's middle.
    width_rad, rng = np.radians(width_deg), np.random.default_rng(8)
    sectors = {180: 32, 127: 64, 22.5: 256, 20: 512, 0.5: 16384}[width_deg]
    table = free_beliefs(CONFIG.most_free)[:, 1]
    along_a_middle = (np.array([0, 7, sectors // 2, sectors - 1]) + 0.5) * 2 * np.pi / sectors  # trust is 1 there
    for axis in [*along_a_middle, 0.0, np.pi / 2, np.pi, *rng.uniform(0, 2 * np.pi, 5)]:
        column, row, reach = int(rng.integers(-90, 90)), int(rng.integers(-90, 90)), float(rng.uniform(0, 80))
        grid = Grid(CONFIG)
        grid.add_free(cones((column, row, axis, reach), width_rad=width_rad))
        said, dx, dy = beliefs_about(grid, column, row, 90)
        sector = np.floor(np.arctan2(dy, dx) / (2 * np.pi) * sectors) % sectors
        middle = (sector + 0.5) * 2 * np.pi / sectors
        trust = np.where(np.hypot(dx, dy) < reach, direction_trust(wrapped(middle - axis), width_rad), 0)
        expected = np.where(trust > 0, table[np.vectorize(free_level)(trust)], 0)
        levels = trust * len(table)
        tie = (np.abs(levels - np.rint(levels)) < 1e-9) & (trust > 0) & (trust < 1 - 1e-9)  # there rounding decides
        apart = np.abs(said[..., 1] - expected)
        assert apart[~tie].max() < 1e-6
        assert apart.max() < CONFIG.most_free / len(table) + 1e-6


@pytest.mark.parametrize(("range_m", "eps_m"), [(1.3, 0.015), (1.3, 0.05), (0.4, 0.2), (0.1, 0.3), (3.9, 0.9)])
def test_the_compiled_kernel_says_of_every_cell_of_a_contact_region_what_the_sensor_models_table_says(range_m, eps_m):
    table, rng = arc_beliefs(CONFIG.most_occupied), np.random.default_rng(9)
    for direction in [0.0, np.pi / 4, -np.pi / 2, np.pi, *rng.uniform(-3, 3, 3)]:
        x_m, y_m = rng.uniform(-1, 1, 2)
        grid = Grid(CONFIG, "dsmc")  # of one reading it makes no more than that reading, without an integral
        grid.add(arcs((x_m, y_m, range_m, direction, eps_m)))
        said, column, row = beliefs_about(grid, 0, 0, 350)
        dx_m, dy_m = (column + 0.5) * CONFIG.cell_m - x_m, (row + 0.5) * CONFIG.cell_m - y_m
        off = off_arc(np.hypot(dx_m, dy_m), range_m, eps_m)
        trust = direction_trust(wrapped(np.arctan2(dy_m, dx_m) - direction), 6 * eps_m / range_m)
        spoken_of, expected = (off <= 1) & (trust > 0), np.zeros_like(said)
        expected[spoken_of] = table[np.vectorize(arc_level)(trust[spoken_of], off[spoken_of])][..., :2]
        assert expected.any()
        np.testing.assert_allclose(said, expected, rtol=0, atol=2e-6)  # single precision


def test_the_space_before_an_arc_is_free_and_each_cell_is_spoken_of_once():
    sweep = survey(paper_room(), paper_path()[:1], np.random.default_rng(1))[0]
    heard = np.isfinite(sweep.range_m)
    grid = Grid(CONFIG)
    grid.add_free(free_space(sweep, CONFIG))
    free = np.stack([tile.free for tile in grid.tiles()])
    assert 0 < free.max() <= CONFIG.most_free  # two beams that both speak of a cell would make it more
    eps_m = float(epsilon_m(sweep.range_sigma_m or 0.0, CONFIG))
    heard &= sweep.range_m > 0.5  # nearer, where the sensor is in its cell decides which level a cell gets
    for direction, range_m in zip(sweep.direction_rad[heard], sweep.range_m[heard], strict=True):
        for ahead_m, believed in ((range_m - eps_m - 0.03, True), (range_m + 0.03, False)):
            x_m, y_m = sweep.x_m + ahead_m * np.cos(direction), sweep.y_m + ahead_m * np.sin(direction)
            assert (at(grid, x_m, y_m)[1] > 0.5 * CONFIG.most_free) == believed, (direction, range_m)


def test_a_range_no_longer_than_its_error_calls_no_cell_free_but_the_sensors_own():
    grid = Grid(CONFIG)
    grid.add(arcs((0.01, 0.01, 1.0, 0.0, 0.02)))
    grid.add_free(cones((0, 0, 0.0, 0.0), (0, 0, 2.0, 0.0)))
    said, dx, dy = beliefs_about(grid, 0, 0, 90)
    assert said[(dx == 0) & (dy == 0), 1] == pytest.approx(CONFIG.most_free * 15 / 16)  # of the highest of 8 levels
    assert not said[(np.hypot(dx, dy) > 0) & (dx < 40)].any()


def test_many_readings_in_one_direction_speak_of_a_cell_but_once_in_a_sweep():
    sweep = survey(paper_room(), paper_path()[:1], np.random.default_rng(1))[0]
    cone = free_space(sweep, CONFIG)
    first = np.flatnonzero(np.isfinite(sweep.range_m))[0]
    object.__setattr__(sweep, "bearing_rad", np.full_like(sweep.bearing_rad, sweep.bearing_rad[first]))
    object.__setattr__(sweep, "range_m", np.full_like(sweep.range_m, sweep.range_m[first]))
    many = free_space(sweep, CONFIG)
    assert len(many.table) == 13 and len(cone.table) < 13
    grid = Grid(CONFIG)
    grid.add_free(many)
    assert 0.8 * CONFIG.most_free < max(tile.free.max() for tile in grid.tiles()) <= CONFIG.most_free


def test_cells_are_free_occupied_or_unknown():
    occupied, free = np.array([0.6, 0.3, 0.1, 0.2, 0.0]), np.array([0.2, 0.7, 0.8, 0.4, 0.0])
    states = [CellState.OCCUPIED, CellState.OCCUPIED, CellState.FREE, CellState.UNKNOWN, CellState.UNKNOWN]
    assert cell_states(occupied, free, CONFIG).tolist() == states
    assert cell_states(occupied, free, GridConfig(free_from=0.9)).tolist()[2] == CellState.UNKNOWN


def test_in_the_papers_room_the_walls_are_occupied_the_floor_free_and_the_outside_unknown():
    mapper = Mapper()
    for sweep in survey(paper_room(), paper_path(), np.random.default_rng(6)):
        mapper.register_sweep(sweep)
    states = {CellState.OCCUPIED: [], CellState.FREE: []}
    for tile in mapper.grid.tiles():
        cells = cell_states(tile.occupied, tile.free, mapper.config.grid)
        for state, found in states.items():
            row, column = np.nonzero(cells == state)
            x, y = centres(tile)
            found.append(np.stack([x[0, column], y[row, 0]], axis=1))
    outside_m = {state: beyond_walls(np.concatenate(found)) for state, found in states.items()}
    # A beam is wider than what answers in it: with the foot of a wall at its edge it reaches R (1 - cos 22.5) behind
    # the wall, 0.08 R, and R is up to 3.7 m here.
    assert np.quantile(outside_m[CellState.FREE], 0.99) < 0.08 * 3.7
    assert np.mean(outside_m[CellState.FREE] > 0.05) < 0.15
    wall = np.abs(outside_m[CellState.OCCUPIED]) < 0.05
    cylinder = np.hypot(*(np.concatenate(states[CellState.OCCUPIED]) - (1.384, 0.480)).T) - 0.448  # Table III
    assert np.mean(wall | (np.abs(cylinder) < 0.05)) > 0.85
    assert wall.sum() > 100


def beyond_walls(places: np.ndarray) -> np.ndarray:
    """How far places (n, 2) lie outside the paper's room, negative inside; the room is convex."""
    start, side = paper_room().vertices, paper_room().ends - paper_room().vertices
    out = np.stack([side[:, 1], -side[:, 0]], axis=1) / np.hypot(*side.T)[:, None]
    return ((places[:, None, :] - start) * out).sum(axis=2).max(axis=1)
