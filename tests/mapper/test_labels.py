"""Labels of a map, so placed that none lies on another."""

from itertools import combinations

from noctule.messages_pb2 import Contour, Cylinder, Point, Wall
from noctule_mapper.rerun_view.labels import Label, labels

PX_M = 1.0 / 88.0  # as the scale has it in viewer/board.png, a page of 1280 to 760 pixels with a room of 3.8 m


def room() -> Contour:
    corners = [Point(), Point(x_m=4.0), Point(x_m=4.0, y_m=3.0), Point(y_m=3.0)]
    walls = [Wall(start=start, end=end) for start, end in zip(corners, [*corners[1:], corners[0]], strict=True)]
    return Contour(walls=walls, cylinders=[Cylinder(x_m=2.0, y_m=1.5, radius_m=0.3)])


def overlapping(found: list[Label]) -> list[tuple[str, str]]:
    """Pairs whose boxes (seven pixels a letter and 20 high, as Rerun draws them nearly) share room."""

    def width_m(label: Label) -> float:
        return PX_M * (7 * len(label.text) + 12)

    return [
        (one.text, other.text)
        for one, other in combinations(found, 2)
        if abs(one.place_m[0] - other.place_m[0]) < (width_m(one) + width_m(other)) / 2
        and abs(one.place_m[1] - other.place_m[1]) < 20 * PX_M
    ]


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


def test_units_at_one_place_share_a_label() -> None:
    found = labels(room(), {"u1": (1.0, 1.0), "u2": (1.0, 1.001), "u3": (3.0, 1.0)})
    assert [label.text for label in found if label.kind == "unit"] == ["u1, u2", "u3"]


def test_a_label_without_room_is_left_out_and_the_more_important_one_stays() -> None:
    crowd = Contour(
        walls=[Wall(start=Point(x_m=2.0, y_m=1.0), end=Point(x_m=2.02 + 0.001 * n, y_m=1.0)) for n in range(9)]
    )
    found = labels(crowd, {"u1": (0.0, 0.0), "u2": (4.0, 3.0)})
    assert [label.text for label in found] == ["u1", "u2", "0.03 m"]


def test_nothing_has_no_labels() -> None:
    assert labels(Contour(), {}) == []


def test_a_units_name_keeps_off_a_cylinder_below_it() -> None:
    units = {"u1": (2.0, 1.5 + 0.3 + 18 * PX_M)}  # its name would hang on the circle's upper edge
    (name,) = [label for label in labels(room(), units) if label.kind == "unit"]
    lowest_m = name.place_m[1] - (10 + 10) * PX_M  # Rerun draws a label ten pixels below its place, and half as high
    assert lowest_m > 1.5 + 0.3 or abs(name.place_m[0] - 2.0) > 0.3
