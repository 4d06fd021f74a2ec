"""A floor plan under the map, from DXF and GeoJSON, and what is said of one that can't be shown."""

import json
from collections.abc import Callable
from math import pi
from pathlib import Path

import numpy as np
import pytest
from ezdxf.filemanagement import new
from ezdxf.layouts.layout import Modelspace
from ezdxf.units import MM

from noctule.messages_pb2 import Contour, Corner, Point, Wall
from noctule_mapper.export.dxf import dxf
from noctule_mapper.export.geojson import geojson
from noctule_viewer import floor_plan
from noctule_viewer.board import site_plan
from noctule_viewer.board.site_plan import SitePlanError
from noctule_viewer.floor_plan import FloorPlanError, Placing

HERE = Placing()


def drawing(path: Path, draw: Callable[[Modelspace], object], units: int = MM) -> Path:
    """A DXF file with what ``draw`` draws in its model space."""
    made = new("R2010", units=units)
    made.layers.add("HIDDEN").off()
    block = made.blocks.new("DOOR")
    block.add_line((0, 0), (900, 0))
    draw(made.modelspace())
    made.saveas(path)
    return path


def test_a_drawing_in_millimetres_is_shown_in_metres(tmp_path: Path) -> None:
    path = drawing(tmp_path / "plan.dxf", lambda space: space.add_line((0, 0), (4_000, 3_000)))
    (line,) = floor_plan.load(path, HERE)
    assert line == pytest.approx(np.array([[0.0, 0.0], [4.0, 3.0]]))


def test_arcs_are_drawn_as_they_bend_and_closed_polylines_closed(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.add_lwpolyline([(0, 0), (4_000, 0), (4_000, 3_000)], close=True)
        space.add_circle((1_000, 1_000), 500)

    triangle, circle = floor_plan.load(drawing(tmp_path / "plan.dxf", draw), HERE)
    assert triangle[0] == pytest.approx(triangle[-1])
    assert len(triangle) == 4
    assert np.hypot(*(circle - 1.0).T) == pytest.approx(0.5, abs=1e-3)
    assert len(circle) > 8


def test_blocks_are_drawn_where_they_are_inserted_and_layers_that_are_off_are_not(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.add_blockref("DOOR", (2_000, 1_000), dxfattribs={"rotation": 90})
        space.add_blockref("DOOR", (5_000, 1_000), dxfattribs={"layer": "HIDDEN"})
        space.add_line((0, 0), (9_000, 0), dxfattribs={"layer": "HIDDEN"})
        space.add_text("kitchen")

    (door,) = floor_plan.load(drawing(tmp_path / "plan.dxf", draw), HERE)
    assert door == pytest.approx(np.array([[2.0, 1.0], [2.0, 1.9]]))


def test_a_drawing_is_scaled_then_turned_then_moved(tmp_path: Path) -> None:
    path = drawing(tmp_path / "plan.dxf", lambda space: space.add_line((0, 0), (4, 0)), units=0)
    (line,) = floor_plan.load(path, floor_plan.placing("1,2,90,0.5"))
    assert line == pytest.approx(np.array([[1.0, 2.0], [1.0, 4.0]]))
    assert floor_plan.placing("1,2,180") == Placing(1.0, 2.0, pi, None)


def contour() -> Contour:
    corners = [Point(), Point(x_m=4.0), Point(x_m=4.0, y_m=3.0)]
    walls = [Wall(start=start, end=end) for start, end in zip(corners, [*corners[1:], corners[0]], strict=True)]
    return Contour(walls=walls, corners=[Corner(x_m=4.0, walls=[0, 1])])


@pytest.mark.parametrize(("name", "export"), [("room.dxf", dxf), ("room.geojson", geojson)])
def test_what_the_mapper_exports_lies_on_what_it_shows(
    tmp_path: Path, name: str, export: Callable[[Contour], bytes]
) -> None:
    path = tmp_path / name
    path.write_bytes(export(contour()))
    lines = floor_plan.load(path, HERE)
    assert any(line == pytest.approx(np.array([[0.0, 0.0], [4.0, 0.0]])) for line in lines if line.shape == (2, 2))


def test_the_rims_of_geojsons_polygons_are_lines(tmp_path: Path) -> None:
    room, hole = [[0, 0], [4, 0, 9], [4, 3], [0, 0]], [[1, 0.2], [2, 0.2], [2, 0.4], [1, 0.2]]
    shapes = [{"type": "Polygon", "coordinates": [room, hole]}, {"type": "Point", "coordinates": [0, 0]}]
    collection = {"type": "GeometryCollection", "geometries": shapes}
    path = tmp_path / "plan.json"
    path.write_text(json.dumps({"type": "Feature", "geometry": collection, "properties": {}}))
    assert [line.tolist() for line in floor_plan.load(path, HERE)] == [
        [[0, 0], [4, 0], [4, 3], [0, 0]],
        [[1, 0.2], [2, 0.2], [2, 0.4], [1, 0.2]],
    ]


def test_what_can_not_be_shown_is_told_with_what_to_do(tmp_path: Path) -> None:
    names = ("plan.pdf", "words.dxf", "empty.dxf", "tiny.geojson", "broken.geojson", "huge.geojson")
    text, words, empty, tiny, broken, huge = (tmp_path / name for name in names)
    text.write_text("%PDF")
    words.write_text("a drawing")
    drawing(empty, lambda space: space.add_text("kitchen"))
    tiny.write_text(json.dumps({"type": "LineString", "coordinates": [[13.3777, 52.5162], [13.3778, 52.5163]]}))
    broken.write_text('{"type": "LineString", "coordinates": [["a", "b"], [1]]}')
    huge.write_text(json.dumps({"type": "LineString", "coordinates": [[0, 0], [10**400, 0]]}))
    unsaid = drawing(tmp_path / "unsaid.dxf", lambda space: space.add_line((0, 0), (4, 0)), units=0)
    many = drawing(tmp_path / "many.dxf", lambda space: space.add_lwpolyline([(n, n % 2) for n in range(50_001)]))
    told = {
        tmp_path / "none.dxf": "there is no file",
        tmp_path: "give a .dxf or a .geojson file",
        text: "give a .dxf or a .geojson file",
        words: "is no DXF drawing that can be read",
        empty: "has no lines in it",
        unsaid: "does not state its units: say how many metres one is",
        tiny: "would be 0.0001 m wide",  # degrees of WGS 84
        broken: "is no GeoJSON",
        huge: "is no GeoJSON",
        many: "of which 50000 can be shown",
    }
    for path, words_told in told.items():
        with pytest.raises(FloorPlanError, match=words_told):
            floor_plan.load(path, HERE)


@pytest.mark.parametrize("parts", [["insert"], ["line", "insert"], ["insert", "insert"]])
def test_a_block_in_itself_is_told(tmp_path: Path, parts: list[str]) -> None:
    def draw(space: Modelspace) -> None:
        assert space.doc is not None
        block = space.doc.blocks.new("SELF")
        for part in parts:
            block.add_line((0, 0), (900, 0)) if part == "line" else block.add_blockref("SELF", (1, 1))
        space.add_blockref("SELF", (0, 0))

    with pytest.raises(FloorPlanError, match="is no DXF drawing that can be read"):
        floor_plan.load(drawing(tmp_path / "plan.dxf", draw), HERE)


def test_blocks_in_blocks_are_unpacked_no_further_than_can_be_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(floor_plan, "MOST_POINTS", 500)

    def draw(space: Modelspace) -> None:
        assert space.doc is not None
        for depth in range(8):  # ten to the eighth doors
            block = space.doc.blocks.new(f"B{depth}")
            for number in range(10):
                block.add_blockref(f"B{depth - 1}" if depth else "DOOR", (number, 0))
        space.add_blockref("B7", (0, 0))

    with pytest.raises(FloorPlanError, match="has more than 500 parts"):
        floor_plan.load(drawing(tmp_path / "plan.dxf", draw), HERE)


@pytest.mark.parametrize("text", ["", "1,2", "1,2,x", "1,2,3,0", "1,2,3,-1", "nan,0,0", "1,2,3,4,5"])
def test_a_place_that_is_none_is_told(text: str) -> None:
    with pytest.raises(FloorPlanError, match="give X,Y,DEGREES"):
        floor_plan.placing(text)


def test_a_site_file_names_the_site_and_has_the_paths_of_carried_units(tmp_path: Path) -> None:
    path = tmp_path / "attic.toml"
    path.write_text(
        'site = "attic"\n[[unit]]\nname = "u1"\nserial = 1\naddress = "socket://127.0.0.1:7101"\n'
        "path = { corners_m = [[0, 0], [1, 0]], spacing_m = 0.5 }\n"
    )
    (plan,) = site_plan.read([str(path)])
    assert plan.site == "attic"
    assert [stop.x_m for stop in plan.paths["u1"]] == pytest.approx([0.0, 0.5, 1.0])
    (plan,) = site_plan.read(["attic"])
    assert plan.paths == {}


def test_of_several_sites_each_has_its_own_floor_plan(tmp_path: Path) -> None:
    path = drawing(tmp_path / "plan.dxf", lambda space: space.add_line((0, 0), (4_000, 0)))
    attic, cellar = site_plan.read(["attic", "cellar"], [f"cellar={path}"], ["cellar=0,1,0"])
    assert attic.floor_plan_m == ()
    (line,) = cellar.floor_plan_m
    assert line == pytest.approx(np.array([[0.0, 1.0], [4.0, 1.0]]))
    (alone,) = site_plan.read(["attic"], [str(path)])
    assert len(alone.floor_plan_m) == 1


@pytest.mark.parametrize(
    ("sites", "drawings", "at", "told"),
    [
        (["attic"], [], ["1,2,3"], "give --floor-plan too"),
        (["attic", "cellar"], ["plan.dxf"], [], "of which site"),
        (["attic", "attic"], [], [], "named twice"),
    ],
)
def test_options_that_do_not_go_together_are_told(
    sites: list[str], drawings: list[str], at: list[str], told: str
) -> None:
    with pytest.raises(SitePlanError, match=told):
        site_plan.read(sites, drawings, at)
