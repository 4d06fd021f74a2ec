"""The picture's free space ends at the walls, seen from the places of the units."""

import numpy as np
import pytest

from noctule.messages_pb2 import Contour, GridTile, Point, Wall
from noctule_mapper.rerun_view.sight import sight

CELL_M = 0.05
ROOM = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)]


def contour(corners_m: list[tuple[float, float]], gap_m: float = 0.0) -> Contour:
    """Walls from corner to corner, each that much shorter at both ends."""
    walls = []
    for start, end in zip(np.array(corners_m), np.roll(corners_m, -1, axis=0), strict=True):
        along = (end - start) / np.linalg.norm(end - start)
        first, last = start + gap_m * along, end - gap_m * along
        walls.append(Wall(start=Point(x_m=first[0], y_m=first[1]), end=Point(x_m=last[0], y_m=last[1])))
    return Contour(walls=walls)


def tile() -> GridTile:
    """Four metres square, the room in its middle."""
    return GridTile(x_m=-1.0, y_m=-1.5, cell_m=CELL_M, rows=80, columns=80)


def centres_m() -> tuple[np.ndarray, np.ndarray]:
    x_m = -1.0 + CELL_M * (np.arange(80) + 0.5)
    y_m = -1.5 + CELL_M * (np.arange(80) + 0.5)
    grid_x_m, grid_y_m = np.meshgrid(x_m, y_m)
    return grid_x_m, grid_y_m


def inside(grow_m: float) -> np.ndarray:
    x_m, y_m = centres_m()
    return (x_m > -grow_m) & (x_m < 2.0 + grow_m) & (y_m > -grow_m) & (y_m < 1.0 + grow_m)


@pytest.mark.parametrize("gap_m", [0.0, 0.02])  # walls that a fit leaves two centimetres short of their corner
def test_from_within_a_room_its_cells_are_seen_and_none_beyond_its_walls_and_corners(gap_m: float) -> None:
    seen = sight(contour(ROOM, gap_m), [(0.5, 0.4), (1.5, 0.6)], CELL_M)
    assert seen is not None
    cells = seen.cells(tile())
    assert cells[inside(-CELL_M)].all()
    assert not cells[~inside(3 * CELL_M)].any()


def test_what_lies_behind_a_wall_is_seen_by_a_unit_that_stands_there() -> None:
    wall = Contour(walls=[Wall(start=Point(x_m=1.0, y_m=-9.0), end=Point(x_m=1.0, y_m=9.0))])
    x_m, _ = centres_m()
    one = sight(wall, [(0.0, 0.0)], CELL_M)
    both = sight(wall, [(0.0, 0.0), (2.0, 0.0)], CELL_M)
    assert one is not None
    assert both is not None
    assert not one.cells(tile())[x_m > 1.2].any()
    assert both.cells(tile()).all()


def test_without_walls_or_places_nothing_is_cut() -> None:
    assert sight(Contour(), [(0.0, 0.0)], CELL_M) is None
    assert sight(contour(ROOM), [], CELL_M) is None


def test_a_wall_that_moves_by_less_than_a_cell_changes_no_picture() -> None:
    places = [(0.5, 0.4)]
    first = sight(contour(ROOM), places, CELL_M)
    assert first is not None
    near, far = (
        sight(contour([(0.0, 0.0), (2.0 + moved_m, 0.0), (2.0 + moved_m, 1.0), (0.0, 1.0)]), places, CELL_M)
        for moved_m in (0.004, 0.4)
    )
    assert near is not None
    assert far is not None
    assert first.is_near(near, within_m=CELL_M)
    assert not first.is_near(far, within_m=CELL_M)
    assert not first.is_near(None, within_m=CELL_M)
