"""The grid has no more tiles than it may; what it has no room for is counted, named, and drawn once there is room."""

from dataclasses import replace

import numpy as np
from mapper.fixed_units import survey_with_people
from mapper.room import paper_path, paper_room, survey
from mapper.test_fixed_units import ON_THE_WALLS, RECTANGLE

from noctule_mapper.config import GridConfig, MapperConfig
from noctule_mapper.grid.grid import Grid, GridTile
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.sweep import SweepReadings

MOST = 60  # tiles: a sweep of the paper's room has some 10


def limited(most_tiles: int = MOST) -> Mapper:
    mapper = Mapper(MapperConfig(grid=GridConfig(most_tiles=most_tiles)))
    mapper.grid.tiles()
    return mapper


def far_apart(count: int) -> list[SweepReadings]:
    """Sweeps along 18 km, no two of which share a tile."""
    (here,) = survey(paper_room(), paper_path()[:1], np.random.default_rng(1))
    along_m = np.linspace(-9000, 9000, count)
    return [replace(here, identity=("log", number), x_m=float(x_m)) for number, x_m in enumerate(along_m)]


def tiles_of(sweep: SweepReadings) -> list[GridTile]:
    mapper = Mapper()
    mapper.register_sweep(sweep)
    return mapper.grid.tiles()


def assert_same(grid: Grid, other: Grid) -> None:
    tiles, others = grid.tiles(), other.tiles()
    assert [(tile.tile_x, tile.tile_y) for tile in tiles] == [(tile.tile_x, tile.tile_y) for tile in others]
    for tile, same in zip(tiles, others, strict=True):
        np.testing.assert_allclose(tile.free, same.free, rtol=0, atol=1e-3)
        np.testing.assert_allclose(tile.occupied, same.occupied, rtol=0, atol=1e-3)


def test_sweeps_spread_over_kilometres_take_no_more_tiles_than_there_may_be() -> None:
    sweeps, mapper = far_apart(100), limited()
    for sweep in sweeps:
        mapper.register_sweep(sweep)
        assert len(mapper.grid.tiles()) <= MOST
    held = len(sweeps) - mapper.off_grid
    assert 1 < held < 20
    assert f"no room for the cells of {mapper.off_grid} sweeps" in mapper.contour().note
    assert mapper.contour().sweeps == len(sweeps), "the contour rests on all of them"
    for sweep in sweeps[:held]:
        mapper.remove_sweep(sweep.identity)
        assert len(mapper.grid.tiles()) <= MOST
    assert mapper.off_grid == len(sweeps) - 2 * held, "as many as have left are drawn in their place"
    for sweep in sweeps[held:]:
        mapper.remove_sweep(sweep.identity)
    assert (mapper.off_grid, mapper.grid.tiles()) == (0, [])


def test_a_contour_does_not_need_the_grid_and_says_nothing_of_its_limit_where_there_is_room() -> None:
    sweeps = survey(paper_room(), paper_path(), np.random.default_rng(3))
    small, large = limited(1), limited()
    for sweep in sweeps:
        small.register_sweep(sweep)
        large.register_sweep(sweep)
    assert (small.off_grid, large.off_grid) == (len(sweeps), 0)
    with_none, with_all = small.contour(), large.contour()
    assert len(with_none.walls) == len(with_all.walls) > 0
    assert "[mapper.grid] most_tiles = 1)" in with_none.note
    assert "most_tiles" not in with_all.note


def test_a_map_at_its_limit_is_as_good_as_one_of_the_sweeps_that_there_was_room_for() -> None:
    rng = np.random.default_rng(11)  # of the echoes of people some turn out not to last
    made = survey_with_people(RECTANGLE, ON_THE_WALLS, rng, people=2, rounds=3)[0]
    sweeps = [replace(one.sweep, x_m=one.sweep.x_m + 300.0 * (number % 3)) for number, one in enumerate(made)]
    mapper = limited(40)
    for sweep in sweeps:
        mapper.register_sweep(sweep)
    assert 0 < mapper.off_grid < len(sweeps)
    for number in rng.permutation(len(sweeps))[: len(sweeps) * 2 // 3]:
        mapper.remove_sweep(sweeps[number].identity)
    while mapper.off_grid:
        mapper.remove_sweep(mapper.sweeps()[-1].identity)
    whole = Mapper()
    for sweep in mapper.sweeps():
        whole.register_sweep(sweep)
    assert whole.grid.tiles()
    assert_same(mapper.grid, whole.grid)
    for sweep in mapper.sweeps():
        mapper.remove_sweep(sweep.identity)
    assert mapper.grid.tiles() == []


def test_room_that_a_wide_sweep_leaves_is_taken_by_all_that_wait_for_it() -> None:
    (here,) = survey(paper_room(), paper_path()[:1], np.random.default_rng(1))
    mapper = limited(wide := len(tiles_of(here)))
    mapper.register_sweep(here)
    short = np.where(here.range_m > 0.1, 0.1, here.range_m)
    for number in range(3):
        mapper.register_sweep(replace(here, identity=("log", 10 + number), x_m=50.0 + 10 * number, range_m=short))
    assert (mapper.off_grid, len(mapper.grid.tiles())) == (3, wide)
    mapper.remove_sweep(here.identity)
    assert (mapper.off_grid, len(mapper.grid.tiles()) > 0) == (0, True)
