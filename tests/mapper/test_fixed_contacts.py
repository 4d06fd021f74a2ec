"""Contacts and the belief grid of units that stand still: a plateau of one place stands for other places nearby."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mapper.fixed_units import FIXED, survey_fixed
from mapper.room import Room, distance_to_sides_m, inside, paper_room, sweep_at
from mapper.test_fixed_units import ON_THE_WALLS, RECTANGLE

from noctule import bounds
from noctule_mapper.choices import Method
from noctule_mapper.config import ContactConfig, MapperConfig
from noctule_mapper.contacts.contact_book import ContactBook
from noctule_mapper.contacts.voting import Contacts, Kind
from noctule_mapper.contour.contour import Contour
from noctule_mapper.grid.grid import CellState, Grid, cell_states
from noctule_mapper.mapper import Mapper
from noctule_mapper.messages import contour_message, features_message
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import echoes_of
from noctule_mapper.readings.looks import looks_of
from noctule_mapper.readings.sweep import SweepReadings

# Off the cells' borders: there two cells share what is known of a wall, and neither is sure of it.
AWAY_M = 0.007
ROOM = Room(RECTANGLE.vertices + AWAY_M)
POSES = np.add(ON_THE_WALLS, (AWAY_M, AWAY_M, 0.0))
SIGMA_M = 0.0032  # of a range, as the room's physics has it
OFF_WALL_M = 0.03  # a cell and a half of 2 cm, of which a region is two wide
# A plateau's middle is known to 2 degrees at 4.5-degree steps: so far beside its foot a contact may be, by range.
DIRECTION_RAD = np.radians(2.0)
LONGEST_FOOT_M = 3.5


@cache
def surveyed() -> tuple[SweepReadings, ...]:
    return tuple(one.sweep for one in survey_fixed(ROOM, POSES, np.random.default_rng(1)))


@cache
def mapped() -> Mapper:
    mapper = Mapper()
    _ = mapper.grid
    for sweep in surveyed():
        mapper.register_sweep(sweep)
    return mapper


def cells(grid: Grid, state: CellState) -> np.ndarray:
    """The middles of cells that are in ``state``, (n, 2)."""
    found = []
    for tile in grid.tiles():
        rows, columns = np.nonzero(cell_states(tile.occupied, tile.free, MapperConfig().grid) == state)
        found.append(np.stack([tile.x_m + (columns + 0.5) * tile.cell_m, tile.y_m + (rows + 0.5) * tile.cell_m], 1))
    return np.concatenate(found)


def off_walls_m(points_m: np.ndarray) -> np.ndarray:
    return np.array([distance_to_sides_m(point, ROOM.vertices).min() for point in points_m])


def off_corners_m(points_m: np.ndarray) -> np.ndarray:
    return np.min([np.hypot(*(points_m - corner).T) for corner in ROOM.vertices], axis=0)


def feet() -> list[tuple[np.ndarray, np.ndarray]]:
    """A unit's place and its foot on a wall, for all pairs that are near enough and inside the unit's sweep."""
    pairs = []
    for x, y, heading_rad in POSES:
        low, high = ROOM.vertices.min(axis=0), ROOM.vertices.max(axis=0)
        for foot in ((low[0], y), (high[0], y), (x, low[1]), (x, high[1])):
            bearing_rad = wrapped(np.arctan2(foot[1] - y, foot[0] - x) - heading_rad)
            if np.hypot(foot[0] - x, foot[1] - y) < LONGEST_FOOT_M and abs(bearing_rad) < np.radians(125):
                pairs.append((np.array([x, y]), np.array(foot)))
    return pairs


def at_feet(points_m: np.ndarray) -> np.ndarray:
    """Of each foot whether a point lies at it, as nearly as its plateau's direction is known, bool (feet,)."""
    return np.array(
        [
            np.hypot(*(points_m - foot).T).min(initial=np.inf) < OFF_WALL_M + DIRECTION_RAD * np.hypot(*(foot - place))
            for place, foot in feet()
        ]
    )


def test_what_units_metres_apart_hear_is_occupied_at_the_walls_feet() -> None:
    assert at_feet(cells(mapped().grid, CellState.OCCUPIED)).all()


def test_every_foot_of_a_wall_that_a_unit_hears_is_a_feature_point() -> None:
    points = mapped().feature_points()
    assert at_feet(np.stack([points.x_m, points.y_m], axis=1)).all()


def test_occupied_cells_lie_on_walls_and_none_farther_inside_the_room_than_an_echo_errs() -> None:
    occupied = cells(mapped().grid, CellState.OCCUPIED)
    off_m = off_walls_m(occupied)
    within = np.array([inside(point, ROOM.vertices) for point in occupied])
    assert len(occupied) > len(feet())
    assert off_m[within].max() < OFF_WALL_M
    # A corner's contact slips past the corner along its arc, by what its direction is off.
    beside_corners = off_corners_m(occupied) < OFF_WALL_M + DIRECTION_RAD * LONGEST_FOOT_M
    assert off_m[~beside_corners].max() < OFF_WALL_M


def test_before_a_foot_lie_free_cells() -> None:
    free = cells(mapped().grid, CellState.FREE)
    middles = np.array([(place + foot) / 2 for place, foot in feet()])
    off_m = np.array([np.hypot(*(free - middle).T).min() for middle in middles])
    assert off_m.max() < 0.02


def test_a_sweep_that_comes_and_goes_leaves_the_grid_as_it_was() -> None:
    mapper = Mapper()
    *kept, last = surveyed()
    for sweep in kept:
        mapper.register_sweep(sweep)
    before = beliefs(mapper.grid)
    mapper.register_sweep(last)
    among = beliefs(mapper.grid)
    mapper.remove_sweep(last.identity)
    after = beliefs(mapper.grid)
    assert before.keys() == after.keys()
    for key, tile in before.items():
        np.testing.assert_allclose(after[key], tile, rtol=0, atol=1e-5)
    assert max(np.abs(among[key] - tile).max() for key, tile in before.items()) > 0.1


def beliefs(grid: Grid) -> dict[tuple[int, int], np.ndarray]:
    return {(tile.tile_x, tile.tile_y): np.stack([tile.occupied, tile.free]) for tile in grid.tiles()}


def test_feature_points_lie_on_walls_or_at_corners() -> None:
    points = mapped().feature_points()
    places = np.stack([points.x_m, points.y_m], axis=1)
    assert len(places) >= 12  # three units' feet on each wall
    assert np.all((off_walls_m(places) < 5 * SIGMA_M) | (off_corners_m(places) < DIRECTION_RAD * LONGEST_FOOT_M))


@pytest.mark.parametrize("method", ["eht-lsm", "hough"])
def test_the_papers_methods_find_the_walls_from_units_that_stand_still(method: Method) -> None:
    mapper = Mapper(MapperConfig(method=method))
    for sweep in surveyed():
        mapper.register_sweep(sweep)
    assert sides(mapper.contour()) == [0, 1, 2, 3]


def sides(contour: Contour) -> list[int | None]:
    """Of each wall the room's side on whose line it lies, by the quarter turn of its normal, None for a false one."""
    low, high = ROOM.vertices.min(axis=0), ROOM.vertices.max(axis=0)
    rho_m = (high[0], high[1], -low[0], -low[1])
    found = []
    for wall in contour.walls:
        side = round(wall.theta_rad / (np.pi / 2)) % 4
        on_line = abs(wall.rho_m - rho_m[side]) < 0.01  # a bin
        on_line &= abs(np.sin(wall.theta_rad - side * np.pi / 2)) < np.sin(np.radians(1.0))
        found.append(side if on_line else None)
    return sorted(found, key=str)


@pytest.mark.parametrize("method", ["eht-lsm", "hough"])
@pytest.mark.parametrize("units", [1, 2])
def test_one_or_two_units_make_nothing_false_by_the_papers_methods(method: Method, units: int) -> None:
    mapper = Mapper(MapperConfig(method=method))
    for one in survey_fixed(ROOM, POSES[:units], np.random.default_rng(units)):
        mapper.register_sweep(one.sweep)
    contour = mapper.contour()
    assert contour.sweeps == 4 * units
    assert None not in sides(contour)
    assert not contour.cylinders


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("method", ["eht-lsm", "hough"])
@settings(max_examples=6, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), units=st.integers(1, 4), share=st.sampled_from([0.05, 0.5, 1.0]))
def test_whatever_fine_sweeps_hear_makes_a_map_by_the_papers_methods(
    method: Method, seed: int, units: int, share: float
) -> None:
    """Ranges from anywhere, many of them the same at many bearings, in place of a room's."""
    rng = np.random.default_rng(seed)
    mapper = Mapper(MapperConfig(method=method))
    for sweep in surveyed()[: 2 * units]:
        range_m = np.where(rng.random(61) < 0.7, rng.choice(rng.uniform(0.02, 4.0, 3), 61), rng.uniform(0.02, 4.0, 61))
        range_m[rng.random(61) >= share] = np.nan
        mapper.register_sweep(replace(sweep, range_m=range_m, no_echo=np.isnan(range_m)))
    bounds.check(contour_message(mapper.contour(), "s"))
    bounds.check(features_message(mapper.feature_points(), "s"))


def test_a_heading_by_eye_takes_no_contact_away() -> None:
    def contacts_of(sigma_heading_rad: float) -> int:
        book = ContactBook(ContactConfig())
        put(book, *(replace(one, sigma_heading_rad=sigma_heading_rad) for one in surveyed()))
        return int((book.contacts().kind != Kind.NONE).sum())

    assert contacts_of(np.radians(5.0)) == contacts_of(0.0) > 0


def put(book: ContactBook, *sweeps: SweepReadings) -> None:
    for one in sweeps:
        book.add(one.identity, one.x_m, one.y_m, echoes_of(one, one.identity[1], SIGMA_M), looks_of([one], SIGMA_M))


def book_of(*sweeps: SweepReadings) -> ContactBook:
    book = ContactBook(ContactConfig())
    put(book, *sweeps)
    return book


@cache
def two_units() -> tuple[SweepReadings, ...]:
    """Twelve sweeps of each of two units, in turns."""
    rngs = map(np.random.default_rng, range(3))
    survey = [one.sweep for rng in rngs for one in survey_fixed(ROOM, POSES[:2], rng)]
    return tuple(replace(sweep, identity=("log", number)) for number, sweep in enumerate(survey))


def same(first: Contacts, second: Contacts) -> None:
    for name in ("direction_rad", "kind", "direction_sigma_rad"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 63)), min_size=8, max_size=24))
@settings(max_examples=25, derandomize=True)
def test_after_any_comings_and_goings_the_contacts_are_those_of_a_book_of_what_is_left(
    steps: list[tuple[bool, int]],
) -> None:
    lived, held = ContactBook(ContactConfig()), []
    for sweep, (goes, which) in zip(two_units(), steps, strict=False):
        if goes and held:
            lived.remove(held.pop(which % len(held)).identity)
        held.append(sweep)
        put(lived, sweep)
    same(lived.contacts(), book_of(*held).contacts())


@given(st.integers(0, 11))
@settings(max_examples=12, derandomize=True)
def test_a_change_tells_of_every_contact_that_a_sweep_takes_with_it(which: int) -> None:
    book = book_of(*two_units()[:12])
    echoes, before = book.echoes(), book.contacts()
    gone = two_units()[which]
    change = book.remove(gone.identity)
    stayed = echoes.sweep != gone.identity[1]
    now = book.contacts()
    moved = (before.direction_rad[stayed] != now.direction_rad) | (before.kind[stayed] != now.kind)
    told = change.echoes.sweep != gone.identity[1]
    assert sorted(change.after.direction_rad[told]) == sorted(now.direction_rad[moved])
    assert sorted(change.before.direction_rad[told]) == sorted(before.direction_rad[stayed][moved])
    # The sweep's own contacts go, every one of them.
    assert (change.before.kind[~told] != Kind.NONE).sum() == (before.kind[~stayed] != Kind.NONE).sum() > 0
    assert set(change.after.kind[~told]) == {Kind.NONE}


def test_a_new_sweep_changes_nothing_that_the_sweeps_of_a_full_place_have_said() -> None:
    unit = [one for one in two_units() if one.x_m == POSES[0][0]]
    book = book_of(*unit[:5])
    new = unit[5]
    change = book.add(new.identity, new.x_m, new.y_m, echoes_of(new, 99, SIGMA_M), looks_of([new], SIGMA_M))
    assert set(change.echoes.sweep) == {99}


def test_coarse_sweeps_have_the_votes_of_fine_ones_beside_them() -> None:
    """Along the lowest wall of the paper's room, 1 m from it, each 40 cm from the next."""
    poses = np.array([(-0.4, 0.4, 0.0), (0.0, 0.4, 0.0), (0.4, 0.4, 0.0)])
    coarse = [sweep_at(paper_room(), pose, number, np.random.default_rng(number)) for number, pose in enumerate(poses)]
    fine = [one.sweep for one in survey_fixed(paper_room(), poses[1:], np.random.default_rng(1), FIXED)[:2]]
    fine = [replace(one, identity=("fine", 10 + number)) for number, one in enumerate(fine)]
    alone = book_of(coarse[0]).contacts()
    beside = book_of(coarse[0], *fine)
    of_coarse = beside.contacts([coarse[0].identity])
    assert set(alone.kind) == {Kind.NONE}
    assert Kind.WALL in of_coarse.kind
    assert not np.isfinite(of_coarse.direction_sigma_rad).any()


def test_a_sweep_with_other_echoes_leaves_a_book_of_those_echoes() -> None:
    unit = [one for one in two_units() if one.x_m == POSES[0][0]]
    fewer = replace(unit[2], range_m=np.where(unit[2].range_m < 1.0, unit[2].range_m, np.nan))
    number, book = fewer.identity[1], book_of(*unit)
    gone, come = book.exchange(fewer.identity, echoes_of(fewer, number, SIGMA_M), looks_of([fewer], SIGMA_M))
    same(book.contacts(), book_of(*unit[:2], fewer, *unit[3:]).contacts())
    assert set(gone.after.kind) == {Kind.NONE}
    # Others share its plateaus, and some contacts of theirs have moved.
    assert (come.echoes.sweep != number).any()
