"""The reliability grid: evidence that comes and goes, by every rule."""

import tracemalloc
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from mapper.grid_probe import arcs, at, centres, cones
from mapper.made_echoes import made_echoes
from mapper.room import paper_path, paper_room, survey
from numba import typeof

from noctule_mapper.choices import Rule
from noctule_mapper.config import GridConfig, MapperConfig
from noctule_mapper.contacts.voting import Contacts, Kind
from noctule_mapper.fusion import fuse
from noctule_mapper.fusion.sensor_model import arc_masses
from noctule_mapper.grid import kernels
from noctule_mapper.grid.grid import Grid
from noctule_mapper.grid.polar_cells import cells_by_sector
from noctule_mapper.grid.regions import Cones, beams_of, contact_regions, free_space
from noctule_mapper.grid.tiles import Tiles
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.sweep import SweepReadings

CONFIG = GridConfig()
RULES = get_args(Rule)
# Three readings of one place from three sides: x_m, y_m, range_m, direction_rad, epsilon_m.
CROSSING = [(0, 0, 1, 0, 0.03), (1, -1, 1, np.pi / 2, 0.03), (1.0, 1.5, 1.49, -np.pi / 2, 0.03)]


def assert_same_beliefs(grid: Grid, other: Grid, tolerance: float = 1e-4) -> None:
    """The same tiles, and in them the same beliefs but for single precision."""
    tiles, others = grid.tiles(), other.tiles()
    assert [(tile.tile_x, tile.tile_y) for tile in tiles] == [(tile.tile_x, tile.tile_y) for tile in others]
    for tile, one in zip(tiles, others, strict=True):
        np.testing.assert_allclose(tile.occupied, one.occupied, rtol=0, atol=tolerance)
        np.testing.assert_allclose(tile.free, one.free, rtol=0, atol=tolerance)


def rounded_arc(line: tuple[float, ...], x_m: float, y_m: float) -> np.ndarray:
    """What a contact region says of a place by Eq. 5-8, trust and distance rounded to 32 steps."""
    dx, dy = x_m - line[0], y_m - line[1]
    off = abs(np.hypot(dx, dy) - line[2]) / line[4]
    trust = 1 - abs(wrapped(np.arctan2(dy, dx) - line[3])) * line[2] / (3 * line[4])
    off, trust = ((min(int(32 * value), 31) + 0.5) / 32 for value in (off, trust))
    occupied, free, _ = CONFIG.most_occupied * arc_masses(1 + 0.1 * off, 0.0, 1.0, 0.1, 1.0) * trust
    return np.array([occupied, free, 1 - occupied - free])


@pytest.mark.parametrize("rule", [rule for rule in RULES if rule != "pcr5"])
def test_a_cell_holds_the_fusion_of_all_that_is_said_of_it(rule):
    grid = Grid(CONFIG, rule)
    grid.add(arcs(*CROSSING[:2]))
    grid.add(arcs(*CROSSING[2:]))
    x_m, y_m = 1.01, 0.01
    said = np.array([rounded_arc(line, x_m, y_m) for line in CROSSING])
    assert said[:, 2].max() < 0.8  # each of the three speaks of the cell
    # Twelve nodes share a product to 1.4e-3 at worst (module quadrature); a grid is shown in 1/255.
    assert at(grid, x_m, y_m) == pytest.approx(fuse(said, rule)[:2], abs=1.4e-3)


def test_a_cell_holds_pcr5_of_two_readings():
    grid = Grid(CONFIG, "pcr5")
    grid.add(arcs(*CROSSING[:2]))
    said = np.array([rounded_arc(line, 1.01, 0.01) for line in CROSSING[:2]])
    assert at(grid, 1.01, 0.01) == pytest.approx(fuse(said, "pcr5")[:2], abs=1e-6)


@pytest.mark.parametrize("rule", RULES)
def test_the_order_of_readings_does_not_matter_to_a_grid(rule):
    one, other = Grid(CONFIG, rule), Grid(CONFIG, rule)
    free = cones((0, 0, 0.0, 60), (50, -40, 1.6, 60))
    one.add(arcs(*CROSSING))
    one.add_free(free)
    other.add_free(free)
    for line in CROSSING[::-1]:
        other.add(arcs(line))
    assert_same_beliefs(one, other)


@pytest.mark.parametrize("rule", RULES)
def test_evidence_taken_out_again_leaves_no_trace_in_what_stays(rule):
    left, grid = Grid(CONFIG, rule), Grid(CONFIG, rule)
    stays, goes = cones((0, 0, 0.0, 60)), cones((50, -40, 1.6, 60), (0, 0, 0.1, 80))
    for one in (left, grid):
        one.add(arcs(*CROSSING[:1]))
        one.add_free(stays)
    grid.add(arcs(*CROSSING[1:]))
    grid.add_free(goes)
    grid.add(arcs(*CROSSING[1:]), sign=-1)
    grid.add_free(goes, sign=-1)
    assert_same_beliefs(grid, left)


def test_a_tile_lies_where_its_cells_do_also_left_of_and_below_the_origin():
    grid = Grid(CONFIG)
    grid.add(arcs((-0.01, -2.79, 1.5, np.pi / 2, 0.015)))  # the contact is at (-0.01, -1.29): column -1, row -65
    tile = max(grid.tiles(), key=lambda tile: tile.occupied.max())
    assert (tile.tile_x, tile.tile_y) == (-1, -2)
    row, column = np.unravel_index(tile.occupied.argmax(), tile.occupied.shape)
    x, y = centres(tile)
    assert (x[0, column], y[row, 0]) == pytest.approx((-0.5 * CONFIG.cell_m, -64.5 * CONFIG.cell_m))


def test_readings_that_are_kilometres_apart_take_no_more_tiles_than_they_touch():
    grid = Grid(CONFIG)
    free = cones((-2_000_010, -1_999_968, 0.0, 30), (1_999_990, 2_000_032, 0.0, 30))
    touched = arcs((-40_000.0, -40_000.0, 1.0, 0.1, 0.02), (40_000.0, 40_000.0, 1.0, 0.1, 0.02))
    grid.add_free(free)
    grid.add(touched)
    tiles = [(tile.tile_x, tile.tile_y) for tile in grid.tiles()]
    assert tiles == [(-31251, -31250), (-31250, -31250), (31249, 31250), (31250, 31250)]
    grid.add_free(free, sign=-1)
    grid.add(touched, sign=-1)
    assert grid.tiles() == []


def test_only_tiles_touched_since_the_last_question_are_told_as_changed():
    grid = Grid(CONFIG)
    grid.add_free(cones((10, 30, 0.0, 20), (200, 30, 0.0, 20)))
    assert [tile.tile_x for tile in grid.changed()] == [0, 3]
    assert grid.changed() == []
    grid.add_free(cones((201, 30, 0.0, 20)))
    assert [tile.tile_x for tile in grid.changed()] == [3]


def test_evidence_taken_out_again_leaves_an_empty_grid_and_tells_the_tile_as_changed():
    grid = Grid(CONFIG)
    readings = arcs((0.5, 0.5, 0.3, 0.2, 0.02), (0.5, 0.5, 0.31, 0.2, 0.02))
    grid.add(readings)
    grid.changed()
    grid.add(readings, sign=-1)
    assert grid.tiles() == []
    (tile,) = grid.changed()
    assert tile.occupied.max() == tile.free.max() == 0


def test_a_tile_that_loses_all_its_evidence_is_told_as_changed_however_much_comes_elsewhere_meanwhile():
    grid = Grid(CONFIG)
    here = cones((10, 10, 0.8, 40))
    grid.add_free(here)
    before = {(tile.tile_x, tile.tile_y) for tile in grid.changed()}
    grid.add_free(here, sign=-1)
    for step in range(1, 20):
        grid.add_free(cones((3000 * step, 3000 * step, 0.8, 40)))
    empty = {(tile.tile_x, tile.tile_y) for tile in grid.changed() if not tile.free.any()}
    assert empty == before
    grid.add_free(here)
    assert {(tile.tile_x, tile.tile_y) for tile in grid.changed()} == before


def test_a_map_that_moves_on_takes_no_more_memory_than_what_is_on_it():
    grid = Grid(CONFIG)
    tracemalloc.start()
    for step in range(400):
        grid.add_free(cones((100 * step, 0, 0.8, 60)))
        grid.add(arcs((2.0 * step, 0, 1.2, 0.8, 0.03)))
        if step >= 3:
            grid.add_free(cones((100 * (step - 3), 0, 0.8, 60)), sign=-1)
            grid.add(arcs((2.0 * (step - 3), 0, 1.2, 0.8, 0.03)), sign=-1)
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # Some ten tiles of 64 x 64 cells at 20 bytes are on it at once; all that ever were are more than a thousand.
    assert len(grid.tiles()) < 16
    assert held < 100 * 64 * 64 * 20


def test_readings_of_fine_and_coarse_sensors_put_in_together_can_be_taken_out_one_by_one():
    echoes, found = echoes_of_spread(np.array([0.003, 0.04, 0.05]))
    config = GridConfig(cell_m=0.01)
    left, grid = Grid(config), Grid(config)
    for one in (left, grid):
        one.add_free(cones((-5, -5, 0.7, 200), (-5, 5, 3.9, 200)))
    grid.add(contact_regions(echoes, found, config))
    for number in range(len(echoes)):
        alone = np.array([number])
        grid.add(contact_regions(echoes.take(alone), found.take(alone), config), sign=-1)
    assert_same_beliefs(grid, left)


def echoes_of_spread(sigmas_m: np.ndarray) -> tuple[Echoes, Contacts]:
    """Echoes from a wall so near that a coarse region bends round the sensor, 16 directions for each spread."""
    direction = np.tile(np.linspace(-3, 3, 16), len(sigmas_m))
    one = np.ones(len(direction))
    echoes = made_echoes(np.zeros((len(one), 2)), 0.15 * one, direction, np.repeat(sigmas_m, 16), half_beam_rad=0.2)
    return echoes, Contacts(direction, 0 * one, np.full(len(one), Kind.WALL), one, np.inf * one)


def test_counts_do_not_run_over_however_often_a_place_is_called_free():
    # 70000 is more than 16 bits hold. Belief is certain long before; only taking readings out again tells.
    grid, left = Grid(CONFIG), Grid(CONFIG)
    cone = cones((30, 30, 0.3, 6))
    many = Cones(np.repeat(cone.table, 70_000, axis=0))
    left.add_free(cone)
    grid.add_free(many)
    grid.add_free(cone)
    grid.add_free(many, sign=-1)
    assert_same_beliefs(grid, left)


def test_a_place_called_free_a_thousand_times_forgets_all_but_the_times_that_stay():
    # A cell's fresh counts are moved on after 127 strokes, so most of what goes here was moved on before it goes.
    turned = np.random.default_rng(4).uniform(0, 2 * np.pi, 1000)
    table = np.concatenate([cones((30, 30, axis, 40)).table for axis in turned])
    grid, left = Grid(CONFIG), Grid(CONFIG)
    grid.add_free(Cones(table))
    grid.add_free(Cones(table[:990]), sign=-1)
    left.add_free(Cones(table[990:]))
    assert_same_beliefs(grid, left, tolerance=0)


def test_counts_of_sweeps_do_not_run_over_either():
    # Here the kernels get arrays that were kept from sweep to sweep; 16 bits hold 65,535.
    (sweep,) = survey(paper_room(), paper_path()[:1], np.random.default_rng(1))
    one, many = (Tiles(CONFIG.tile_cells, CONFIG.cell_m, np.zeros((1, 1), np.float32)) for _ in range(2))
    _count(one, sweep, 1)
    _count(many, sweep, 70_000)
    slots = many.slots()
    assert slots.keys() == one.slots().keys()
    for key, slot in one.slots().items():
        assert one.counts(slot).any()
        np.testing.assert_array_equal(many.counts(slots[key]), 70_000 * one.counts(slot))


def _count(tiles: Tiles, sweep: SweepReadings, times: int) -> None:
    """Count the sweep's cones in so often."""
    beams, sectors = beams_of(sweep, CONFIG), 256
    for _ in range(times):
        if not tiles.count_sweep(beams, len(sweep.range_m), sectors, 1):
            tiles.count_cones(free_space(sweep, CONFIG).table, sectors, 1)


def test_a_sweep_put_in_a_thousand_times_forgets_all_but_the_times_that_stay():
    (sweep,) = survey(paper_room(), paper_path()[:1], np.random.default_rng(1))
    grid, left = Grid(CONFIG), Grid(CONFIG)
    for _ in range(1000):
        grid.add_sweep(sweep)
    for _ in range(990):
        grid.add_sweep(sweep, sign=-1)
    for _ in range(10):
        left.add_sweep(sweep)
    assert_same_beliefs(grid, left, tolerance=0)


def test_sweeps_of_sensors_of_many_widths_may_come_from_anywhere_in_turn():
    # The window moves with the first sweep of each place; what was kept for the other widths is then out of date.
    (here,) = survey(paper_room(), paper_path()[:1], np.random.default_rng(1))
    widths_rad = np.radians([6, 9, 15, 22.5, 45, 90])
    sweeps = [
        replace(here, x_m=here.x_m + 20.0 * place, beam_width_rad=float(width_rad))
        for place in range(6)
        for width_rad in widths_rad[:: (-1) ** place]
    ]
    one, other = Grid(CONFIG), Grid(CONFIG)
    for sweep in [*sweeps, *sweeps[::-1]]:
        one.add_sweep(sweep)
        one.add(arcs((sweep.x_m + 10.0, sweep.y_m, 1, 0, 0.03)))
        one.add_sweep(sweep)
        for _ in range(2):
            other.add_free(free_space(sweep, CONFIG))
        other.add(arcs((sweep.x_m + 10.0, sweep.y_m, 1, 0, 0.03)))
    assert len(one.tiles()) > 12
    assert_same_beliefs(one, other, tolerance=0)


def test_sensors_of_nearly_one_width_share_a_table():
    (here,) = survey(paper_room(), paper_path()[:1], np.random.default_rng(1))
    grid = Grid(CONFIG)
    grid.add_sweep(here)
    made = cells_by_sector.cache_info().misses
    for width_rad in np.radians(np.linspace(22.5, 30, 40)):
        grid.add_sweep(replace(here, beam_width_rad=float(width_rad)))
    assert cells_by_sector.cache_info().misses == made


def test_all_evidence_of_a_long_walk_can_be_in_one_call_or_in_many():
    sweeps = survey(paper_room(), paper_path(), np.random.default_rng(5))
    parts = [free_space(sweep, CONFIG) for sweep in sweeps]
    one, many = Grid(CONFIG), Grid(CONFIG)
    one.add_free(Cones(np.concatenate([part.table for part in parts])))
    for part in parts:
        many.add_free(part)
    assert_same_beliefs(one, many, tolerance=0)


@pytest.mark.parametrize("rule", RULES)
def test_walking_through_the_papers_room_and_taking_every_sweep_back_leaves_nothing(rule):
    sweeps = survey(paper_room(), paper_path()[:15], np.random.default_rng(3))
    lived, left = (Mapper(MapperConfig(rule=rule)) for _ in range(2))
    left.register_sweep(sweeps[0])
    for sweep in sweeps:
        lived.register_sweep(sweep)
    for sweep in sweeps[:0:-1]:
        lived.remove_sweep(sweep.identity)
    assert_same_beliefs(lived.grid, left.grid)
    lived.remove_sweep(sweeps[0].identity)
    assert lived.grid.tiles() == []


def test_the_compiled_functions_get_just_the_types_that_they_were_compiled_for(monkeypatch):
    """They are called without Numba's look at each argument: anything else would be read as what it is not."""
    calls = dict.fromkeys(("cones", "sweep", "arcs", "contacts"), 0)

    def looked_at(name, call, signatures):
        def looking(*arguments):
            calls[name] += 1
            assert tuple(map(typeof, arguments)) in signatures
            return call(*arguments)

        return looking

    arcs, contacts = kernels.stroke_arcs.signatures, kernels.stroke_contacts.signatures
    monkeypatch.setattr(kernels, "ARCS", looked_at("arcs", kernels.ARCS, arcs))
    monkeypatch.setattr(kernels, "CONTACTS", looked_at("contacts", kernels.CONTACTS, contacts))
    for of, call in kernels.CONES_OF_COUNTS.items():
        monkeypatch.setitem(kernels.CONES_OF_COUNTS, of, looked_at("cones", call, kernels.stroke_cones.signatures))
    for of, call in kernels.SWEEP_OF_COUNTS.items():
        monkeypatch.setitem(kernels.SWEEP_OF_COUNTS, of, looked_at("sweep", call, kernels.stroke_sweep.signatures))
    mapper = Mapper(MapperConfig())
    for sweep in survey(paper_room(), paper_path()[:30], np.random.default_rng(1)):
        mapper.register_sweep(sweep)
        assert mapper.grid.tiles()
    assert min(calls.values()) > 1
