"""noctule-mapper export: what other people's programs read in the files is the contour that was exported."""

import json
import math
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pyogrio.raw
import pytest
import shapely
import yaml
from google.protobuf import json_format
from mapper.command import Result, noctule_mapper
from mapper.live_site import paper_survey
from PIL import Image

from noctule import survey
from noctule.messages_pb2 import (
    POSE_STATE_OPEN,
    POSE_STATE_WRONG,
    Contour,
    Corner,
    Cylinder,
    Point,
    Pose,
    Touch,
    UnitPose,
    Wall,
)
from noctule_mapper.export.atomic_write import write_whole

FREE, OCCUPIED, UNKNOWN = 0, 100, -1  # as in a nav_msgs/OccupancyGrid


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A survey of the paper's room, its contour as fit writes it, and both as every export."""
    made = tmp_path_factory.mktemp("export")
    with (made / "survey.jsonl").open("w") as stream:
        survey.write(paper_survey(), stream)
    assert noctule_mapper("fit", made / "survey.jsonl", "--contour", made / "contour.json").exit_code == 0
    for name in ("room.geojson", "room.dxf", "outline.yaml"):
        result = export(made / "contour.json", made / name)
        assert result.exit_code == 0, result.complaint
    assert export(made / "survey.jsonl", made / "grid.yaml").exit_code == 0
    return made


@pytest.fixture(scope="module")
def contour(folder: Path) -> Contour:
    found = json_format.Parse((folder / "contour.json").read_text(), Contour())
    # Liu et al. 2019, Tables I-III: five walls, five corners, one cylinder.
    assert (len(found.walls), len(found.corners), len(found.cylinders)) == (5, 5, 1)
    return found


def export(source: Path, out: Path, *options: str) -> Result:
    return noctule_mapper("export", source, out, *options)


def write(path: Path, contour: Contour) -> Path:
    path.write_text(survey.to_json(contour))
    return path


def inner_wall_contour() -> Contour:
    """A square room of 2 m in which a square pillar of 0.4 m stands, every wall with the room on its left."""
    contour = Contour(site="pillar")
    for points in ([(0, 0), (2, 0), (2, 2), (0, 2)], [(0.8, 0.8), (0.8, 1.2), (1.2, 1.2), (1.2, 0.8)]):
        before = len(contour.walls)
        for number, (start, end) in enumerate(zip(points, points[1:] + points[:1], strict=True)):
            contour.walls.append(Wall(start=Point(x_m=start[0], y_m=start[1]), end=Point(x_m=end[0], y_m=end[1])))
            after = before + (number + 1) % 4
            contour.corners.append(Corner(x_m=end[0], y_m=end[1], walls=[before + number, after]))
    return contour


# ---- GeoJSON, read by GDAL and by shapely


def features(file: Path) -> dict[str, list[tuple[Any, dict]]]:
    """The features by kind as GDAL reads them."""
    head, _, geometries, columns = pyogrio.raw.read(file)
    rows = [dict(zip(head["fields"], values, strict=True)) for values in zip(*columns, strict=True)]
    kinds: dict[str, list[tuple[Any, dict]]] = {}
    for wkb, row in zip(geometries, rows, strict=True):
        kinds.setdefault(row["kind"], []).append((shapely.from_wkb(wkb), row))
    return kinds


def test_gdal_finds_every_wall_corner_and_cylinder_in_the_geojson(folder, contour):
    found = features(folder / "room.geojson")
    assert {kind: len(of_kind) for kind, of_kind in found.items()} == {
        "wall": 5,
        "corner": 5,
        "cylinder": 1,
        "outline": 1,
    }
    for (line, row), wall in zip(found["wall"], contour.walls, strict=True):
        ends = [(wall.start.x_m, wall.start.y_m), (wall.end.x_m, wall.end.y_m)]
        assert np.array(line.coords) == pytest.approx(np.array(ends))
        assert (row["rho_m"], row["theta_rad"], row["readings"]) == (wall.rho_m, wall.theta_rad, wall.readings)
    for (point, _), corner in zip(found["corner"], contour.corners, strict=True):
        assert (point.x, point.y) == pytest.approx((corner.x_m, corner.y_m))
    disc, row = found["cylinder"][0]
    (cylinder,) = contour.cylinders
    assert (disc.centroid.x, disc.centroid.y) == pytest.approx((cylinder.x_m, cylinder.y_m))
    assert row["radius_m"] == cylinder.radius_m
    assert disc.area == pytest.approx(32 * math.sin(math.tau / 64) * cylinder.radius_m**2)  # a 64-gon's


def test_the_closed_outline_is_a_polygon_through_the_corners(folder, contour):
    polygon, row = features(folder / "room.geojson")["outline"][0]
    corners = {(round(corner.x_m, 9), round(corner.y_m, 9)) for corner in contour.corners}
    assert polygon.is_valid
    assert polygon.exterior.is_ccw
    assert {(round(x, 9), round(y, 9)) for x, y in polygon.exterior.coords} == corners
    assert polygon.area == pytest.approx(row["area_m2"])


def test_the_geojson_says_that_it_is_in_metres_and_keeps_the_covariances(folder, contour):
    collection = json.loads((folder / "room.geojson").read_text())
    assert collection["type"] == "FeatureCollection"
    assert collection["noctule"]["frame"].startswith("metres")
    assert "crs" not in collection, "RFC 7946, section 4: it has been removed from the format"
    covariances = [each["properties"]["covariance"] for each in collection["features"] if "outline" not in each["id"]]
    objects = (*contour.walls, *contour.corners, *contour.cylinders)
    assert covariances == [list(one.covariance) for one in objects]


def test_a_pillars_outline_is_anticlockwise_too(tmp_path):
    assert export(write(tmp_path / "c.json", inner_wall_contour()), tmp_path / "c.geojson").exit_code == 0
    outlines = features(tmp_path / "c.geojson")["outline"]
    assert [polygon.area for polygon, _ in outlines] == pytest.approx([4.0, 0.16])
    assert all(polygon.exterior.is_ccw for polygon, _ in outlines), "RFC 7946, section 3.1.6"


def test_touches_are_points_with_their_chances_and_walls_bear_theirs(tmp_path):
    contour = Contour(
        walls=[Wall(end=Point(x_m=1.0), chance=0.997), Wall(start=Point(y_m=1.0), end=Point(x_m=1.0, y_m=1.0))],
        touches=[Touch(x_m=0.5, y_m=2.0, unit="u1", chance_wall=0.6, chance_corner=0.3, chance_cylinder=0.1)],
    )
    source = write(tmp_path / "contour.json", contour)
    for out in ("touches.geojson", "touches.dxf"):
        result = export(source, tmp_path / out)
        assert result.exit_code == 0, result.complaint
    found = features(tmp_path / "touches.geojson")
    ((point, row),) = found["touch"]
    assert (point.x, point.y) == (0.5, 2.0)
    assert (row["unit"], row["chance_wall"], row["chance_corner"], row["chance_cylinder"]) == ("u1", 0.6, 0.3, 0.1)
    assert [row["chance"] for _, row in found["wall"]] == [0.997, 1.0]
    drawing = ezdxf.readfile(tmp_path / "touches.dxf")  # pyright: ignore[reportPrivateImportUsage]
    (mark,) = drawing.modelspace().query("POINT[layer=='TOUCHES']")
    assert tuple(mark.dxf.location)[:2] == (0.5, 2.0)


def contour_with_units() -> Contour:
    """A unit whose pose is wrong, and one whose pose nobody knows."""
    wrong = UnitPose(unit="u1", x_m=1.5, y_m=0.5, heading_rad=0.25, covariance=[1e-4] * 9, state=POSE_STATE_WRONG)
    unknown = UnitPose(unit="u2", stated=Pose(sigma_position_m=100), state=POSE_STATE_OPEN)
    return Contour(site="room", poses=[wrong, unknown])


def test_units_are_points_in_the_geojson_and_the_dxf_where_their_place_is_known(tmp_path):
    file = write(tmp_path / "c.json", contour_with_units())
    for name in ("c.geojson", "c.dxf"):
        assert export(file, tmp_path / name).exit_code == 0
    ((point, row),) = features(tmp_path / "c.geojson")["unit"]
    assert ((point.x, point.y), row["unit"], row["state"], row["heading_rad"]) == ((1.5, 0.5), "u1", "wrong", 0.25)
    space: Any = ezdxf.readfile(tmp_path / "c.dxf").modelspace()  # pyright: ignore[reportPrivateImportUsage]
    (unit,) = space.query("POINT[layer=='UNITS']")
    assert tuple(unit.dxf.location)[:2] == (1.5, 0.5)


# ---- DXF, read by ezdxf and by GDAL


def test_ezdxf_finds_every_object_on_its_layer(folder, contour):
    drawing = ezdxf.readfile(folder / "room.dxf")  # pyright: ignore[reportPrivateImportUsage]
    assert not drawing.audit().errors
    assert drawing.header["$INSUNITS"] == 6  # metres
    space: Any = drawing.modelspace()
    lines = space.query("LINE[layer=='WALLS']")
    for line, wall in zip(lines, contour.walls, strict=True):
        assert tuple(line.dxf.start)[:2] == pytest.approx((wall.start.x_m, wall.start.y_m))
        assert tuple(line.dxf.end)[:2] == pytest.approx((wall.end.x_m, wall.end.y_m))
    for point, corner in zip(space.query("POINT[layer=='CORNERS']"), contour.corners, strict=True):
        assert tuple(point.dxf.location)[:2] == pytest.approx((corner.x_m, corner.y_m))
    for circle, cylinder in zip(space.query("CIRCLE[layer=='CYLINDERS']"), contour.cylinders, strict=True):
        assert tuple(circle.dxf.center)[:2] == pytest.approx((cylinder.x_m, cylinder.y_m))
        assert circle.dxf.radius == pytest.approx(cylinder.radius_m)
    (outline,) = space.query("LWPOLYLINE[layer=='OUTLINE']")
    assert outline.closed
    assert len(outline) == 5
    assert len(space) == 5 + 5 + 1 + 1


def test_gdal_finds_the_same_on_the_layers(folder, contour):
    head, _, geometries, columns = pyogrio.raw.read(folder / "room.dxf")
    layers = list(columns[list(head["fields"]).index("Layer")])
    assert {layer: layers.count(layer) for layer in layers} == {"WALLS": 5, "CORNERS": 5, "CYLINDERS": 1, "OUTLINE": 1}
    shapes: dict[str, Any] = dict(zip(layers, map(shapely.from_wkb, geometries), strict=True))
    assert shapes["CYLINDERS"].length == pytest.approx(math.tau * contour.cylinders[0].radius_m, rel=0.01)
    polygon, _ = features(folder / "room.geojson")["outline"][0]
    assert shapes["OUTLINE"].length == pytest.approx(polygon.length)


# ---- The ROS map, read by Pillow and PyYAML and taken as nav2 takes it


class RosMap:
    """A map by the rules of nav2_map_server/src/map_io.cpp, mode trinary: loadMapYaml() and loadMapFromFile()."""

    def __init__(self, file: Path) -> None:
        says = yaml.safe_load(file.read_text())
        assert (says["mode"], says["negate"]) == ("trinary", 0)
        with Image.open(file.parent / says["image"]) as image:
            assert (image.format, image.mode) == ("PPM", "L")
            occupied = 1 - np.asarray(image) / 255
        cells = np.full(occupied.shape, UNKNOWN)
        cells[occupied < says["free_thresh"]] = FREE
        cells[occupied > says["occupied_thresh"]] = OCCUPIED
        self.cells = cells[::-1]  # the image's first row is the map's last
        self.cell_m = says["resolution"]
        self.x_m, self.y_m, turn_rad = says["origin"]
        assert turn_rad == 0

    def at(self, x_m: float, y_m: float) -> int:
        row, column = math.floor((y_m - self.y_m) / self.cell_m), math.floor((x_m - self.x_m) / self.cell_m)
        return int(self.cells[row, column])


@pytest.mark.parametrize("name", ["grid.yaml", "outline.yaml"])
def test_walls_and_cylinders_are_occupied_in_the_ros_map(folder, contour, name):
    ros = RosMap(folder / name)
    for wall in contour.walls:
        for share in np.linspace(0.001, 0.999, 500):
            x_m = wall.start.x_m + share * (wall.end.x_m - wall.start.x_m)
            y_m = wall.start.y_m + share * (wall.end.y_m - wall.start.y_m)
            around = [ros.at(x_m + dx, y_m + dy) for dx in (-1e-6, 1e-6) for dy in (-1e-6, 1e-6)]
            assert OCCUPIED in around
    (cylinder,) = contour.cylinders
    for turn_rad in np.linspace(0, math.tau, 60):
        inside_m = cylinder.radius_m - ros.cell_m
        x_m, y_m = cylinder.x_m + inside_m * math.cos(turn_rad), cylinder.y_m + inside_m * math.sin(turn_rad)
        assert ros.at(x_m, y_m) == OCCUPIED


def test_what_a_unit_looked_through_is_free(folder, contour):
    ros = RosMap(folder / "grid.yaml")
    polygon, _ = features(folder / "room.geojson")["outline"][0]
    seen_m2 = polygon.area - math.pi * contour.cylinders[0].radius_m ** 2
    assert 0.8 * seen_m2 < float((ros.cells == FREE).sum()) * ros.cell_m**2 < seen_m2
    assert [ros.at(x_m, y_m) for x_m, y_m in [(0.0, 0.6), (0.4, 0.8), (0.0, 1.0)]] == [FREE] * 3


@pytest.mark.parametrize("name", ["grid.yaml", "outline.yaml"])
def test_nothing_behind_the_walls_is_free(folder, name):
    # The grid by itself has free cells there: the beams that hear a corner are wider than the corner.
    ros = RosMap(folder / name)
    polygon, _ = features(folder / "room.geojson")["outline"][0]
    rows, columns = np.nonzero(ros.cells == FREE)
    x_m, y_m = ros.x_m + (columns + 0.5) * ros.cell_m, ros.y_m + (rows + 0.5) * ros.cell_m
    assert len(x_m) > 10_000
    assert shapely.contains_xy(polygon, x_m, y_m).all()


def test_the_map_of_a_contour_alone_is_free_inside_its_outline(folder, contour):
    ros = RosMap(folder / "outline.yaml")
    polygon, _ = features(folder / "room.geojson")["outline"][0]
    covered_m2 = polygon.area - math.pi * contour.cylinders[0].radius_m ** 2
    border_m2 = polygon.length * ros.cell_m  # walls' cells lie half in, half out, and are wider where they run aslant
    assert float((ros.cells == FREE).sum()) * ros.cell_m**2 == pytest.approx(covered_m2, abs=1.5 * border_m2)


def test_what_is_in_a_pillar_is_not_free(tmp_path):
    assert export(write(tmp_path / "c.json", inner_wall_contour()), tmp_path / "c.yaml").exit_code == 0
    ros = RosMap(tmp_path / "c.yaml")
    places = [(0.4, 0.4), (1.6, 1.0), (1.0, 1.0), (0.8, 1.0), (2.05, 1.0)]
    assert [ros.at(*place) for place in places] == [FREE, FREE, UNKNOWN, OCCUPIED, UNKNOWN]


def test_a_map_too_large_for_an_image_is_refused(tmp_path):
    far = Contour(cylinders=[Cylinder(x_m=x_m, y_m=x_m, radius_m=0.1) for x_m in (-9000.0, 9000.0)])
    result = export(write(tmp_path / "far.json", far), tmp_path / "far.yaml")
    assert result.exit_code == 1
    assert "900" in result.complaint and "cells of 0.02 m" in result.complaint
    assert [each.name for each in tmp_path.iterdir()] == ["far.json"]


# ---- What all formats share


@pytest.mark.parametrize("source", ["empty.json", "empty.jsonl"])
def test_an_empty_contour_is_a_valid_file_of_each_format(tmp_path, source):
    (tmp_path / source).write_text(survey.to_json(Contour()) if source == "empty.json" else "")
    for name in ("a.geojson", "a.dxf", "a.yaml"):
        result = export(tmp_path / source, tmp_path / name)
        assert result.exit_code == 0, result.complaint
    assert json.loads((tmp_path / "a.geojson").read_text())["features"] == []
    assert len(ezdxf.readfile(tmp_path / "a.dxf").modelspace()) == 0  # pyright: ignore[reportPrivateImportUsage]
    assert (RosMap(tmp_path / "a.yaml").cells == UNKNOWN).all()


def test_open_walls_have_no_outline(contour, tmp_path):
    opened = Contour()
    opened.CopyFrom(contour)
    del opened.corners[0]
    assert export(write(tmp_path / "open.json", opened), tmp_path / "open.geojson").exit_code == 0
    found = features(tmp_path / "open.geojson")
    assert (len(found["wall"]), len(found["corner"]), "outline" in found) == (5, 4, False)


def test_a_survey_and_its_contour_export_alike(folder):
    assert export(folder / "survey.jsonl", folder / "again.geojson").exit_code == 0
    assert (folder / "again.geojson").read_text() == (folder / "room.geojson").read_text()


def test_a_suffix_of_no_format_is_a_mistake_of_the_command_line(folder, tmp_path):
    result = export(folder / "contour.json", tmp_path / "room.svg")
    assert (result.exit_code, ".geojson" in result.complaint, list(tmp_path.iterdir())) == (2, True, [])


@pytest.mark.parametrize(
    ("source", "out", "options", "complaint"),
    [
        ("contour.json", "a.dxf", ["--method", "refined"], "is fitted already"),
        ("nowhere.json", "a.dxf", [], "nowhere.json"),
        ("contour.json", "nowhere/a.dxf", [], "nowhere"),
        ("broken.json", "a.dxf", [], "not JSON"),
        ("other.json", "a.dxf", [], "is not a contour"),
        ("nan.json", "a.geojson", [], "walls[0].rho_m is nan"),
    ],
)
def test_what_can_not_be_exported_is_told_in_one_line(folder, tmp_path, source, out, options, complaint):
    (tmp_path / "contour.json").write_text((folder / "contour.json").read_text())
    (tmp_path / "broken.json").write_text("{")
    (tmp_path / "other.json").write_text('{"walls": 3}')
    (tmp_path / "nan.json").write_text('{"walls": [{"rho_m": "NaN"}]}')
    before = sorted(tmp_path.iterdir())
    result = export(tmp_path / source, tmp_path / out, *options)
    assert result.exit_code == 1
    assert complaint in result.complaint
    assert result.complaint.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before


def test_a_map_half_of_which_can_not_be_written_leaves_the_old_one(folder, tmp_path):
    (tmp_path / "room.pgm").mkdir()
    (tmp_path / "room.yaml").write_text("old")
    assert export(folder / "contour.json", tmp_path / "room.yaml").exit_code == 1
    assert (tmp_path / "room.yaml").read_text() == "old"
    assert {each.name for each in tmp_path.iterdir()} == {"room.pgm", "room.yaml"}


def test_a_file_that_can_not_be_written_is_named_and_not_the_one_beside_it(tmp_path):
    target = tmp_path / "missing" / "room.svg"
    with pytest.raises(FileNotFoundError) as refused:
        write_whole({target: b"<svg/>"})
    assert refused.value.filename == str(target)
