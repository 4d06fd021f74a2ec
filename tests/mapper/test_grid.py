"""The reliability grid: streaming fusion in cells, free space before the arcs, contact regions on them."""

import numpy as np
import pytest
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.config import GridConfig
from noctule_mapper.fusion import fuse
from noctule_mapper.grid import CellMasses, Grid
from noctule_mapper.mapper import Mapper
from noctule_mapper.regions import free_space

CONFIG = GridConfig()
MASSES = np.array([(0.6, 0.1, 0.3), (0.1, 0.4, 0.5), (0.3, 0.0, 0.7)])


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


def test_the_space_before_an_arc_is_free_and_each_cell_is_spoken_of_once():
    sweep = survey(paper_room(), paper_path()[:1], np.random.default_rng(1))[0]
    cells, free = free_space(sweep, CONFIG)
    assert len(np.unique(cells, axis=0)) == len(cells)
    assert free.min() > 0 and free.max() <= CONFIG.most_free
    away_m = np.hypot(*((cells + 0.5) * CONFIG.cell_m - (sweep.x_m, sweep.y_m)).T)
    assert away_m.max() < np.nanmax(sweep.range_m)


def test_walking_through_the_papers_room_and_taking_every_sweep_back_leaves_nothing():
    sweeps = survey(paper_room(), paper_path()[:15], np.random.default_rng(3))
    mapper = Mapper()
    for sweep in sweeps:
        mapper.register_sweep(sweep)
    assert mapper.grid.tiles()
    for sweep in sweeps[::-1]:
        mapper.remove_sweep(sweep.identity)
    assert mapper.grid.tiles() == []
