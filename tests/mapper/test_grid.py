"""The reliability grid: streaming fusion in cells, free space before the arcs, contact regions on them."""

import numpy as np
import pytest
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.config import GridConfig
from noctule_mapper.contacts import Contacts, Kind
from noctule_mapper.echoes import Echoes
from noctule_mapper.fusion import fuse
from noctule_mapper.grid import CellMasses, Grid
from noctule_mapper.mapper import Mapper
from noctule_mapper.regions import contact_regions, free_space

CONFIG = GridConfig()
MASSES = np.array([(0.6, 0.1, 0.3), (0.1, 0.4, 0.5), (0.3, 0.0, 0.7)])
EVIDENCE = ("log_product", "occupied_share", "free_share", "log_unknown")


def assert_holds_what_is_left(grid: Grid, left: Grid) -> None:
    """The evidence of both is the same but for single precision, cell by cell, and so is the number of its pieces."""
    assert left._tiles
    assert grid._tiles.keys() == left._tiles.keys()
    for key, tile in grid._tiles.items():
        assert tile.held == left._tiles[key].held
        for name in EVIDENCE:
            np.testing.assert_allclose(getattr(tile, name), getattr(left._tiles[key], name), rtol=0, atol=1e-4)


def test_a_cell_holds_the_fusion_of_all_that_is_said_of_it():
    grid = Grid(CONFIG)
    grid.add(CellMasses(np.array([(3, 5), (3, 5)]), MASSES[:2]))
    grid.add(CellMasses(np.array([(3, 5)]), MASSES[2:]))
    (tile,) = grid.tiles()
    # Twelve nodes share a product to 1.2e-3 at worst (module quadrature); a grid is shown in 1/255.
    assert (tile.occupied[5, 3], tile.free[5, 3]) == pytest.approx(fuse(MASSES)[:2], abs=1.2e-3)
    assert tile.occupied.sum() == pytest.approx(tile.occupied[5, 3], abs=1e-5)


def test_a_tile_lies_where_its_cells_do_also_left_of_and_below_the_origin():
    grid = Grid(CONFIG)
    grid.add(CellMasses(np.array([(-1, -65)]), MASSES[:1]))
    (tile,) = grid.tiles()
    row, column = np.argwhere(tile.occupied > 0.1)[0]
    assert (tile.tile_x, tile.tile_y) == (-1, -2)
    assert tile.x_m + (column + 0.5) * tile.cell_m == pytest.approx(-0.5 * CONFIG.cell_m)
    assert tile.y_m + (row + 0.5) * tile.cell_m == pytest.approx(-64.5 * CONFIG.cell_m)


def test_only_tiles_touched_since_the_last_question_are_told_as_changed():
    grid = Grid(CONFIG)
    grid.add(CellMasses(np.array([(0, 0), (200, 0)]), MASSES[:2]))
    assert len(grid.changed()) == 2
    assert grid.changed() == []
    grid.add(CellMasses(np.array([(201, 0)]), MASSES[:1]))
    assert [tile.tile_x for tile in grid.changed()] == [200 // CONFIG.tile_cells]


def test_evidence_taken_out_again_leaves_an_empty_grid_and_tells_the_tile_as_changed():
    grid = Grid(CONFIG)
    beliefs = CellMasses(np.array([(3, 5), (3, 5), (4, 5)]), MASSES)
    grid.add(beliefs)
    grid.changed()
    grid.add(beliefs, sign=-1)
    assert grid.tiles() == []
    (tile,) = grid.changed()
    assert tile.occupied.max() == tile.free.max() == 0


def test_evidence_taken_out_again_leaves_no_trace_in_what_stays():
    left, grid = Grid(CONFIG), Grid(CONFIG)
    stays = CellMasses(np.array([(3, 5)]), MASSES[:1])
    goes = CellMasses(np.array([(3, 5), (3, 5), (4, 5)]), MASSES)
    left.add(stays)
    grid.add(goes)
    grid.add(stays)
    grid.add_free(np.array([(3, 5), (9, 9)]), np.array([0.3, 0.2]))
    grid.add(goes, sign=-1)
    grid.add_free(np.array([(3, 5), (9, 9)]), np.array([0.3, 0.2]), sign=-1)
    assert_holds_what_is_left(grid, left)


def test_readings_of_fine_and_coarse_sensors_put_in_together_can_be_taken_out_one_by_one():
    echoes, found = echoes_of_spread(np.array([0.003, 0.04, 0.05]))
    config = GridConfig(cell_m=0.01)
    left, grid = Grid(config), Grid(config)
    anchor = CellMasses(np.mgrid[-2:2, -2:2].reshape(2, -1).T * config.tile_cells, np.tile(MASSES[0], (16, 1)))
    for one in (left, grid):
        one.add(anchor)
    grid.add(contact_regions(echoes, found, config))
    for number in range(len(echoes)):
        alone = np.array([number])
        grid.add(contact_regions(echoes.take(alone), found.take(alone), config), sign=-1)
    assert_holds_what_is_left(grid, left)
    grid.add(anchor, sign=-1)
    assert grid.tiles() == []


def echoes_of_spread(sigmas_m: np.ndarray) -> tuple[Echoes, Contacts]:
    """Echoes from a wall so near that a coarse region bends round the sensor, 16 directions for each spread."""
    direction = np.tile(np.linspace(-3, 3, 16), len(sigmas_m))
    one = np.ones(len(direction))
    echoes = Echoes(
        sweep=np.arange(len(one)),
        x_m=0 * one,
        y_m=0 * one,
        axis_rad=direction,
        half_beam_rad=0.2 * one,
        range_m=0.15 * one,
        sigma_m=np.repeat(sigmas_m, 16),
        calibrated=one > 0,
        sigma_position_m=0 * one,
        sigma_heading_rad=0 * one,
    )
    return echoes, Contacts(direction, 0 * one, np.full(len(one), Kind.WALL), one)


def test_the_space_before_an_arc_is_free_and_each_cell_is_spoken_of_once():
    sweep = survey(paper_room(), paper_path()[:1], np.random.default_rng(1))[0]
    cells, free = free_space(sweep, CONFIG)
    assert len(np.unique(cells, axis=0)) == len(cells)
    assert free.min() > 0 and free.max() <= CONFIG.most_free
    away_m = np.hypot(*((cells + 0.5) * CONFIG.cell_m - (sweep.x_m, sweep.y_m)).T)
    assert away_m.max() < np.nanmax(sweep.range_m)


def test_walking_through_the_papers_room_and_taking_every_sweep_back_leaves_nothing():
    sweeps = survey(paper_room(), paper_path()[:15], np.random.default_rng(3))
    lived, left = Mapper(), Mapper()
    left.register_sweep(sweeps[0])
    for sweep in sweeps:
        lived.register_sweep(sweep)
    for sweep in sweeps[:0:-1]:
        lived.remove_sweep(sweep.identity)
    assert_holds_what_is_left(lived.grid, left.grid)
    lived.remove_sweep(sweeps[0].identity)
    assert lived.grid.tiles() == []
