"""Labels of a map, so placed that none lies on another."""

import random
from itertools import combinations

import numpy as np
import pytest
import rerun as rr
from mapper.room import paper_path, paper_room

from noctule.messages_pb2 import Contour, Cylinder, Point, Wall
from noctule.unit_colours import Colour, unit_colour
from noctule_mapper.rerun_view.labels import Label, labels
from noctule_mapper.rerun_view.map import draw_labels

PX_M = 1.0 / 88.0  # as the scale has it in viewer/board.png, a page of 1280 to 760 pixels with a room of 3.8 m


def room() -> Contour:
    corners = [Point(), Point(x_m=4.0), Point(x_m=4.0, y_m=3.0), Point(y_m=3.0)]
    walls = [Wall(start=start, end=end) for start, end in zip(corners, [*corners[1:], corners[0]], strict=True)]
    return Contour(walls=walls, cylinders=[Cylinder(x_m=2.0, y_m=1.5, radius_m=0.3)])


def overlapping(found: list[Label], px_m: float = PX_M) -> list[tuple[str, str]]:
    """Pairs whose boxes (seven pixels a letter and 20 high, as Rerun draws them nearly) share room."""

    def width_m(label: Label) -> float:
        return px_m * (7 * len(label.text) + 12)

    return [
        (one.text, other.text)
        for one, other in combinations(found, 2)
        if abs(one.place_m[0] - other.place_m[0]) < (width_m(one) + width_m(other)) / 2
        and abs(one.place_m[1] - other.place_m[1]) < 20 * px_m
    ]


def lies_on(circle: Cylinder, label: Label, px_m: float) -> bool:
    """Whether the box of ``label`` has a part of the ring in it."""
    middle_m = (label.place_m[0], label.place_m[1] - 10 * px_m)  # Rerun draws a label ten pixels below its place
    half_m = ((7 * len(label.text) + 12) / 2 * px_m, 10 * px_m)
    off_m = np.abs(np.subtract(middle_m, (circle.x_m, circle.y_m)))
    nearest_m, farthest_m = np.hypot(*np.maximum(off_m - half_m, 0.0)), np.hypot(*(off_m + half_m))
    return bool(nearest_m <= circle.radius_m <= farthest_m)


def test_a_room_has_the_lengths_of_its_walls_at_their_middles() -> None:
    found = labels(room(), {})
    assert [label.text for label in found] == ["r 0.30 m", "4.00 m", "4.00 m", "3.00 m", "3.00 m"]
    assert [label.place_m for label in found[1:]] == [(2.0, 0.0), (2.0, 3.0), (4.0, 1.5), (0.0, 1.5)]


def test_walls_and_cylinders_bear_errors_from_a_centimetre_on_where_there_is_room() -> None:
    contour = room()
    contour.walls[0].covariance[:] = [0.0, 0.0, 0.0, 0.032**2]
    contour.walls[1].covariance[:] = [0.0, 0.0, 0.0, 0.009**2]
    contour.walls[3].covariance[:] = [0.0, 0.0, 0.0, 0.07**2]  # 100 times its root is a bit more than 7
    contour.cylinders[0].covariance[:] = [0.0] * 8 + [0.015**2]
    assert [label.text for label in labels(contour, {})] == [
        "r 0.30 m ±2 cm",
        "4.00 m ±4 cm",
        "4.00 m",
        "3.00 m",
        "3.00 m ±7 cm",
    ]
    crowd = {f"u{number}": (0.5 + number, 0.0) for number in range(4)}  # their names hang below the wall, as its length
    texts = [label.text for label in labels(contour, crowd)]
    assert "4.00 m ±4 cm" not in texts
    assert "4.00 m" in texts


def test_no_label_lies_on_another_however_close_units_stand_to_a_walls_middle() -> None:
    units = {f"u{number}": (0.1 + 0.2 * number, 0.1) for number in range(20)}
    found = labels(room(), units)
    assert overlapping(found) == []
    names = [label.text for label in found if label.kind == "unit"]
    assert set(units) == {name for label in names for name in label.split(", ")}


def test_twenty_units_in_the_papers_room_are_all_named_whoever_was_heard_first() -> None:
    vertices = [Point(x_m=x_m, y_m=y_m) for x_m, y_m in paper_room().vertices]
    walls = [Wall(start=start, end=end) for start, end in zip(vertices, [*vertices[1:], vertices[0]], strict=True)]
    circles = [Cylinder(x_m=x_m, y_m=y_m, radius_m=radius_m) for x_m, y_m, radius_m in paper_room().cylinders]
    path = paper_path()
    units = {f"u{stop * 20 // len(path) + 1}": (x_m, y_m) for stop, (x_m, y_m, _) in enumerate(path)}
    rng = random.Random(1)
    for _ in range(20):
        order = rng.sample(sorted(units), len(units))
        found = labels(Contour(walls=walls, cylinders=circles), {unit: units[unit] for unit in order})
        assert overlapping(found, px_m=3.73 / 340.0) == []  # the room is 3.73 m wide
        assert sorted(label.text for label in found if label.kind == "unit") == sorted(units)
        assert sum(label.kind == "wall" for label in found) == 5
    in_order = labels(Contour(walls=walls, cylinders=circles), {f"u{n}": units[f"u{n}"] for n in range(1, 21)})
    for label in in_order:
        if label.kind == "unit":
            assert not lies_on(circles[0], label, 3.73 / 340.0)
            dots = [Cylinder(x_m=x_m, y_m=y_m, radius_m=0.001) for x_m, y_m in units.values()]
            assert not any(lies_on(dot, label, 3.73 / 340.0) for dot in dots), "it seems to be another unit's"


def test_a_units_name_has_its_colour_so_that_it_is_known_from_afar_and_a_shared_one_is_white() -> None:
    ((_, names),) = draw_labels(Contour(), {"u1": (0.0, 0.0), "u2": (2.0, 0.0), "u3": (2.0, 0.0)})
    assert isinstance(names, rr.Points2D) and names.labels is not None and names.colors is not None

    def packed(colour: Colour) -> int:
        red, green, blue = colour
        return red << 24 | green << 16 | blue << 8 | 0xFF

    assert names.labels.as_arrow_array().to_pylist() == ["u1", "u2, u3"]
    assert names.colors.as_arrow_array().to_pylist() == [packed(unit_colour("u1")), packed((236, 240, 245))]


def test_units_at_one_place_share_a_label() -> None:
    found = labels(room(), {"u1": (1.0, 1.0), "u2": (1.0, 1.001), "u3": (3.0, 1.0)})
    assert [label.text for label in found if label.kind == "unit"] == ["u1, u2", "u3"]


def test_a_label_without_room_is_left_out_and_the_more_important_one_stays() -> None:
    crowd = Contour(
        walls=[Wall(start=Point(x_m=2.0, y_m=1.0), end=Point(x_m=2.03 + 0.0001 * n, y_m=1.0)) for n in range(9)]
    )
    found = labels(crowd, {"u1": (0.0, 0.0), "u2": (4.0, 3.0)})
    assert [label.text for label in found] == ["u1", "u2", "0.03 m", "0.03 m"]  # on a wall and above it


def test_nothing_has_no_labels() -> None:
    assert labels(Contour(), {}) == []


@pytest.mark.parametrize("degrees", [40, 90, 125])
def test_a_units_name_keeps_off_a_cylinder_below_it_and_near_its_unit(degrees: float) -> None:
    centre_m, radius_m = (2.0, 1.5), 0.3
    at_rad = np.radians(degrees)
    under_m = (centre_m[0] + radius_m * np.cos(at_rad), centre_m[1] + radius_m * np.sin(at_rad))
    unit_m = (under_m[0], under_m[1] + 18 * PX_M)  # its name would hang on the ring
    (name,) = [label for label in labels(room(), {"u1": unit_m}) if label.kind == "unit"]
    assert not lies_on(Cylinder(x_m=centre_m[0], y_m=centre_m[1], radius_m=radius_m), name, PX_M)
    middle_m = (name.place_m[0], name.place_m[1] - 10 * PX_M)  # Rerun draws a label ten pixels below its place
    assert np.hypot(*np.subtract(middle_m, unit_m)) < 30 * PX_M, "above or beside the unit"
