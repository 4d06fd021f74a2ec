"""The demo's rooms: each of the simulator's has a site file that says of its units what the simulator has them do."""

import math
import re
import subprocess
import tomllib
from pathlib import Path

import pytest
from rooms import USUAL, names, site_file, site_name, units
from system.processes import ROOT
from truth import load_room

from noctule.site import FixedPose, Site, WaypointPath, load

ROOMS = ROOT / "firmware/simulator/rooms"


def site_of(room: str, folder: Path) -> Site:
    """The room's site file, read as the gateway reads it."""
    path = folder / "site.toml"
    path.write_text(site_file(room, unit_port=30_000))
    return load(path)


def simulated(room: str) -> dict:
    return tomllib.loads((ROOMS / f"{room}.toml").read_text())


def test_every_room_of_the_simulator_is_a_room_of_the_demo() -> None:
    assert names() == sorted(path.stem for path in ROOMS.glob("*.toml"))
    refusal = subprocess.run(["noctule-sim", "--room", "nowhere"], capture_output=True, text=True)
    assert sorted(refusal.stderr.split("simulator: ")[1].strip().split(", ")) == names()
    assert USUAL in names()


@pytest.mark.parametrize("room", names())
def test_units_stand_or_are_carried_where_the_simulator_has_them(room: str, tmp_path: Path) -> None:
    site, truth = site_of(room, tmp_path), simulated(room)
    assert (site.name, len(site.units), site.clock) == (site_name(room), units(room), "unit")
    assert len(site.units) == len(truth.get("unit", ())) or (len(site.units) == 1 and "path" in truth)
    for number, unit in enumerate(site.units):
        assert (unit.serial, unit.address) == (number + 1, f"socket://127.0.0.1:{30_000 + number}")
        match unit.pose:
            case FixedPose(pose):
                there = truth["unit"][number]
                assert (pose.x_m, pose.y_m) == tuple(there["position_m"])
                assert math.degrees(pose.heading_rad) == pytest.approx(there["heading_deg"])
                assert unit.start  # nobody presses its button
            case WaypointPath():
                assert tomllib.loads(site_file(room, 30_000))["unit"][0]["path"] == truth["path"]
            case other:
                pytest.fail(f"{other}: the simulator publishes no poses")


@pytest.mark.parametrize("room", names())
def test_the_air_is_as_the_site_file_says_to_2_kelvin(room: str, tmp_path: Path) -> None:
    """2 K are 0.35 % of a range, 1.2 cm at 3.5 m."""
    truth = simulated(room)
    schedule = truth.get("air_temperature_schedule") or [{"temperature_c": truth["air_temperature_c"]}]
    stated_c = site_of(room, tmp_path).air_temperature_c
    assert stated_c is not None
    assert all(abs(point["temperature_c"] - stated_c) <= 2.0 for point in schedule)


@pytest.mark.parametrize("page", ["deploy/README.md", "firmware/simulator/README.md"])
def test_the_pages_name_every_room(page: str) -> None:
    rows = re.findall(r"^\| `([\w-]+)`[^|]*\| .*\|$", (ROOT / page).read_text(), re.M)
    assert set(names()) <= set(rows)


def test_what_moves_is_no_part_of_the_truth_that_a_map_is_compared_with(tmp_path: Path) -> None:
    file = tmp_path / "room.toml"
    file.write_text(
        """
        [[wall]]
        from_m = [0.0, 0.0]
        to_m = [4.0, 0.0]
        [[wall]]
        path = [{ at_s = 0.0, from_m = [4.0, 0.0], to_m = [4.0, 0.9] }]
        [[cylinder]]
        center_m = [1.0, 1.0]
        radius_m = 0.1
        [[cylinder]]
        path = [{ at_s = 0.0, center_m = [2.0, 1.0] }]
        radius_m = 0.2
        [[person]]
        radius_m = 0.22
        doors_m = [[-1.0, 1.0]]
        away_s = [40.0, 100.0]
        """
    )
    room = load_room(file)
    assert (room.walls, room.cylinders) == ((((0.0, 0.0), (4.0, 0.0)),), ((1.0, 1.0, 0.1),))
