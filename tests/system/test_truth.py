"""Setting a contour beside the room: what is off, missing or invented is said."""

import math

import pytest
from truth import Room, compare, describe, describe_complete

from noctule.messages_pb2 import Contour, Corner, Cylinder, Point, Wall

SQUARE = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
ROOM = Room(
    walls=tuple((SQUARE[i], SQUARE[(i + 1) % 4]) for i in range(4)),
    cylinders=((2.0, 2.0, 0.3),),
)


def the_room_itself() -> Contour:
    return Contour(
        walls=[Wall(start=Point(x_m=a[0], y_m=a[1]), end=Point(x_m=b[0], y_m=b[1])) for a, b in ROOM.walls],
        corners=[Corner(x_m=x, y_m=y) for x, y in SQUARE],
        cylinders=[Cylinder(x_m=x, y_m=y, radius_m=r) for x, y, r in ROOM.cylinders],
    )


def test_the_room_itself_is_complete_and_without_error() -> None:
    comparison = compare(the_room_itself(), ROOM)
    assert comparison.complete
    assert comparison.invented == 0
    assert comparison.mean_corner_error_m == 0.0
    assert comparison.cylinder_errors_m == ((0.0, 0.0),)


def test_a_corner_and_a_cylinder_are_as_far_off_as_they_are() -> None:
    contour = the_room_itself()
    contour.corners[0].x_m += 0.03
    contour.corners[0].y_m += 0.04
    contour.cylinders[0].radius_m -= 0.02
    comparison = compare(contour, ROOM)
    assert comparison.mean_corner_error_m == pytest.approx(0.05 / 4)
    assert comparison.cylinder_errors_m == ((0.0, pytest.approx(0.02)),)


def test_what_is_not_in_the_room_is_invented_and_what_is_not_on_the_map_is_missing() -> None:
    contour = the_room_itself()
    contour.walls.append(Wall(start=Point(x_m=1.0, y_m=1.0), end=Point(x_m=3.0, y_m=1.0)))
    contour.cylinders[0].x_m = 3.0
    del contour.corners[1]
    comparison = compare(contour, ROOM)
    assert (comparison.invented_walls, comparison.invented_corners, comparison.invented_cylinders) == (1, 0, 1)
    assert comparison.corner_errors_m == (0.0, None, 0.0, 0.0)
    assert comparison.cylinder_errors_m == (None,)
    assert not comparison.complete


def test_an_empty_map_has_no_corner_error_to_tell() -> None:
    assert math.isnan(compare(Contour(), ROOM).mean_corner_error_m)


def test_a_map_without_a_corner_says_so_in_words() -> None:
    contour = the_room_itself()
    contour.sweeps = 1
    del contour.corners[:]
    first = describe(compare(contour, ROOM), contour, ROOM).splitlines()[0]
    assert first == "1 sweep, 4 of the room's 4 walls, no corner yet"


def test_a_complete_map_is_counted_in_words() -> None:
    contour = the_room_itself()
    assert describe_complete(contour) == (
        "The map is complete: 4 walls, 4 corners, 1 cylinder; more sweeps make it more accurate"
    )
