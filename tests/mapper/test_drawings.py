"""What fit draws: an SVG with an element for each thing, a recording with the live map's entities, and the viewer."""

import os
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import rerun.chunk
from google.protobuf import json_format
from mapper.command import Result, noctule_mapper
from mapper.live_site import SITE, paper_survey

from noctule import rerun_paths, survey
from noctule.messages_pb2 import Contour, Corner, Cylinder, Point, Wall
from noctule_mapper.export.svg import NAMESPACE, svg
from noctule_mapper.readings.sweep import SweepReadings


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "survey.jsonl"
    with path.open("w") as stream:
        survey.write(paper_survey(), stream)
    return path


def fit(file: Path, *options: object) -> Result:
    return noctule_mapper("fit", file, *options)


def drawn(document: bytes) -> dict[str, Counter[str]]:
    """How many elements of each name each group has."""
    root = ET.fromstring(document)
    return {
        group.attrib["id"]: Counter(element.tag.removeprefix(f"{{{NAMESPACE}}}") for element in group)
        for group in root.iter(f"{{{NAMESPACE}}}g")
    }


def sweep(range_m: list[float]) -> SweepReadings:
    """A unit at (1, 2) that looks along y, its bearings ahead and a quarter to each side."""
    return SweepReadings(
        identity=("a", 1),
        unit="u1",
        time_s=0.0,
        x_m=1.0,
        y_m=2.0,
        heading_rad=np.pi / 2,
        sigma_position_m=0.0,
        sigma_heading_rad=0.0,
        bearing_rad=np.array([0.0, np.pi / 2, -np.pi / 2]),
        range_m=np.array(range_m),
        no_echo=np.isnan(range_m),
        beam_width_rad=0.4,
        range_sigma_m=None,
    )


def test_a_fit_draws_what_it_prints(file: Path) -> None:
    picture, contour_file = file.with_name("map.svg"), file.with_name("contour.json")
    result = fit(file, "--svg", picture, "--contour", contour_file)
    assert result.exit_code == 0, result.complaint
    contour = json_format.Parse(contour_file.read_text(), Contour())
    groups = drawn(picture.read_bytes())
    assert groups["walls"] == Counter(line=len(contour.walls))
    assert groups["corners"] == Counter(circle=len(contour.corners))
    assert groups["cylinders"] == Counter(circle=len(contour.cylinders))
    places = {(one.pose.x_m, one.pose.y_m) for one in paper_survey()}
    assert groups["units"] == Counter(circle=len(places), line=len(places), text=1)
    heard = sum(reading.HasField("time_of_flight_s") for one in paper_survey() for reading in one.readings)
    assert 0 < groups["echoes"]["circle"] <= heard


def test_a_drawing_is_to_scale_with_y_upwards() -> None:
    contour = Contour(
        walls=[Wall(start=Point(x_m=0.0, y_m=0.0), end=Point(x_m=4.0, y_m=0.0))],
        corners=[Corner(x_m=4.0, y_m=3.0)],
        cylinders=[Cylinder(x_m=2.0, y_m=1.0, radius_m=0.5)],
    )
    root = ET.fromstring(svg(contour, [sweep([1.0, np.nan, 1.0])]))
    groups = {group.attrib["id"]: list(group) for group in root.iter(f"{{{NAMESPACE}}}g")}
    at = {
        name: [
            {key: float(value) for key, value in one.attrib.items() if key in ("x1", "x2", "y1", "y2", "cx", "cy", "r")}
            for one in group
        ]
        for name, group in groups.items()
    }
    (wall,) = at["walls"]
    px_per_m = (wall["x2"] - wall["x1"]) / 4
    assert at["cylinders"][0]["r"] == pytest.approx(0.5 * px_per_m, abs=0.1)
    assert wall["y1"] - at["cylinders"][0]["cy"] == pytest.approx(px_per_m, abs=0.2)
    ahead, right = at["echoes"]
    assert (ahead["cx"] - wall["x1"], wall["y1"] - ahead["cy"]) == pytest.approx((px_per_m, 3 * px_per_m), abs=0.2)
    assert (right["cx"] - wall["x1"], wall["y1"] - right["cy"]) == pytest.approx((2 * px_per_m, 2 * px_per_m), abs=0.2)
    bar, label = at["scale"][0], groups["scale"][-1].text
    assert label is not None
    assert bar["x2"] - bar["x1"] == pytest.approx(float(label.removesuffix(" m")) * px_per_m, abs=0.2)


@pytest.mark.parametrize("sweeps", [[], [sweep([np.nan] * 3)]])
def test_nothing_found_is_a_drawing_too(sweeps: list[SweepReadings]) -> None:
    groups = drawn(svg(Contour(), sweeps))
    assert set(groups) == {"echoes", "cylinders", "walls", "touches", "corners", "units", "lengths", "scale"}
    assert groups["walls"] == Counter()


def test_names_from_a_file_can_not_break_the_drawing() -> None:
    root = ET.fromstring(svg(Contour(site='<&">'), []))
    assert root.findtext(f"{{{NAMESPACE}}}title") == 'Contour of <&">'


def test_a_recording_holds_the_entities_of_the_live_map(file: Path) -> None:
    result = fit(file, "--rrd", file.with_name("map.rrd"))
    assert result.exit_code == 0, result.complaint
    reader = rerun.chunk.RrdReader(file.with_name("map.rrd"))
    (recording,) = reader.recordings()
    assert (recording.application_id, recording.recording_id) == (rerun_paths.APPLICATION_ID, SITE)
    assert reader.blueprints()
    statics, sweeps = set(), set()
    for chunk in reader.stream(store=recording).to_chunks():
        if chunk.is_static:
            statics.add(chunk.entity_path)
        elif chunk.entity_path == f"/{rerun_paths.unit_rays('u1')}":
            sweeps |= set(chunk.to_record_batch().column(rerun_paths.SWEEP).to_pylist())
    lasting = (
        rerun_paths.WORLD,
        rerun_paths.WALLS,
        rerun_paths.CORNERS,
        rerun_paths.CYLINDERS,
        rerun_paths.FEATURES,
        rerun_paths.ECHOES,
    )
    assert {f"/{path}" for path in lasting} <= statics
    assert any(path.startswith(f"/{rerun_paths.GRID}/") for path in statics)
    assert sweeps == set(range(len(paper_survey())))


def test_a_recording_that_can_not_be_written_is_told_in_one_line(file: Path) -> None:
    folder = file.with_name("folder.rrd")
    folder.mkdir()
    result = fit(file, "--rrd", folder)
    assert result.exit_code == 1
    assert "folder.rrd" in result.complaint
    assert result.complaint.count("\n") == 1


def test_the_viewer_is_opened_on_the_recording(file: Path, monkeypatch: pytest.MonkeyPatch, capfd) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    for options, recording in (
        (("--view",), "survey.rrd"),
        (("--view", "--rrd", file.with_name("map.rrd")), "map.rrd"),
    ):
        result = fit(file, *options)
        assert result.exit_code == 0, result.complaint
        told = capfd.readouterr().out
        assert f"There is no screen here. Copy {file.with_name(recording)} to where there is one" in told
        assert file.with_name(recording).stat().st_size > 0


def test_where_the_viewer_is_not_installed_what_to_install_is_told(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.executable", str(file.parent / "bin" / "python"))  # of an environment without it
    monkeypatch.setenv("PATH", os.devnull)
    result = fit(file, "--view", "--rrd", file.with_name("map.rrd"))
    assert result.exit_code == 1
    assert "noctule-viewer is not here: install noctule-viewer" in result.complaint
    assert file.with_name("map.rrd").exists(), "what was drawn stays"


@pytest.mark.parametrize("option", ["--rrd", "--contacts", "--svg", "--contour"])
def test_a_file_for_which_the_disk_has_no_room_is_named(option: str, tmp_path: Path) -> None:
    file = tmp_path / "survey.jsonl"
    with file.open("w") as stream:
        survey.write(paper_survey()[:2], stream)
    suffix = {"--rrd": ".rrd", "--contacts": ".csv", "--svg": ".svg", "--contour": ".json"}[option]
    full = tmp_path / f"full{suffix}"
    full.symlink_to("/dev/full")  # where every write fails so
    result = fit(file, option, full)
    assert result.exit_code == 1
    assert result.complaint.startswith(f"noctule-mapper: {full}: ") and "No space left" in result.complaint
