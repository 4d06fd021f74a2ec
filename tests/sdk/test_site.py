"""A site file becomes a Site, or an error that tells its author what to change."""

import math
from pathlib import Path

import pytest

from noctule import site
from noctule.errors import SiteFileError

PAPER = """
site = "paper-room"
air_temperature_c = 21.0
clock = "unit"
[sensor]
beam_width_deg = 22.5
range_bias_m = 0.0023
[[unit]]
name = "u1"
serial = 1
address = "socket://127.0.0.1:7101"
path = { corners_m = [[-0.70, -0.45], [2.00, -0.45], [2.00, 1.05], [-0.70, 1.05]], spacing_m = 0.20, closed = true }
pose_sigma = { position_m = 0.004, heading_deg = 0.35 }
sweep = { first_bearing_deg = -135, bearing_step_deg = 22.5, count = 13, pings = 3, start = true, pause_s = 0.5 }
[unit.sensor]
range_sigma_m = 0.0032
"""
HEAD = 'site = "room"\n'
UNIT = '[[unit]]\nname = "u1"\nserial = 1\naddress = "/dev/ttyUSB0"\n'
HERE = "pose = { x_m = 1, y_m = 2, heading_deg = 90 }\n"


def load(tmp_path: Path, text: str) -> site.Site:
    path = tmp_path / "site.toml"
    path.write_text(text)
    return site.load(path)


def test_the_papers_path_has_44_waypoints(tmp_path):
    """Liu et al. 2019, Fig. 17(b): 44 poses around the rectangle."""
    source = load(tmp_path, PAPER).unit("u1").pose
    assert isinstance(source, site.WaypointPath)
    assert len(source.poses) == 44


def test_a_waypoint_lies_on_its_side_and_looks_along_it(tmp_path):
    source = load(tmp_path, PAPER).unit("u1").pose
    assert isinstance(source, site.WaypointPath)
    # 2.70 m by 0.20 m is 14 steps, so waypoint 13 is 2.60 m along the first side and 14 is the second corner.
    expected = {
        0: (-0.70, -0.45, 0.0),
        13: (1.90, -0.45, 0.0),
        14: (2.00, -0.45, math.pi / 2),
        43: (-0.70, -0.35, -math.pi / 2),
    }
    for waypoint, place in expected.items():
        pose = source.poses[waypoint]
        assert (pose.x_m, pose.y_m, pose.heading_rad) == pytest.approx(place)
        assert (pose.sigma_position_m, pose.sigma_heading_rad) == (0.004, math.radians(0.35))


def test_a_side_of_a_whole_number_of_steps_gains_none_by_rounding(tmp_path):
    path = "path = { corners_m = [[0.0, 0.0], [0.3, 0.0], [0.3, 0.7]], spacing_m = 0.1 }\n"
    source = load(tmp_path, HEAD + UNIT + path).unit("u1").pose
    assert isinstance(source, site.WaypointPath)
    assert len(source.poses) == 3 + 7 + 1
    last = source.poses[-1]
    assert (last.x_m, last.y_m, last.heading_rad) == pytest.approx((0.3, 0.7, math.pi / 2))


def test_a_units_sensor_and_plan_come_in_radians_over_the_sites_default(tmp_path):
    loaded = load(tmp_path, PAPER)
    unit = loaded.unit("u1")
    assert (loaded.name, loaded.air_temperature_c, loaded.clock) == ("paper-room", 21.0, "unit")
    assert unit.sensor == site.Sensor(math.radians(22.5), 0.0023, 0.0032)
    assert unit.plan is not None
    assert (unit.plan.first_bearing_rad, unit.plan.count, unit.plan.pings) == (math.radians(-135), 13, 3)
    assert not unit.plan.HasField("ping_interval_s")
    assert (unit.start, unit.pause_s) == (True, 0.5)


def test_what_is_left_out_stays_unknown_and_nothing_starts_by_itself(tmp_path):
    loaded = load(tmp_path, HEAD + UNIT + HERE)
    unit = loaded.unit("u1")
    assert (loaded.air_temperature_c, loaded.clock) == (None, "utc")
    assert (unit.sensor, unit.plan, unit.start, unit.pause_s) == (site.Sensor(), None, False, 0.0)
    assert not unit.sensor.message().HasField("beam_width_rad")
    assert unit.pose == site.FixedPose(site.Pose2(1.0, 2.0, math.pi / 2))


def test_a_tracked_unit_has_its_pose_on_the_bus(tmp_path):
    assert load(tmp_path, HEAD + UNIT + 'pose = "key"\n').unit("u1").pose == site.PoseKey()


def test_an_unknown_unit_is_told_with_the_known_ones(tmp_path):
    with pytest.raises(SiteFileError, match="no unit 'u9': it has u1"):
        load(tmp_path, HEAD + UNIT + HERE).unit("u9")


MISTAKES = {
    "": "site is missing: add it",
    "site = 'r'": "unit is missing",
    "site = ": "not a TOML file",
    "site = '*'\n" + UNIT + HERE: "site is '\\*'",
    "site = 'Room'\n" + UNIT + HERE: "site is 'Room'.*lower-case",
    HEAD + "unit = []\n": "unit must be an array of tables",
    HEAD + "clock = 'gps'\n" + UNIT + HERE: "clock is 'gps': choose 'utc' or 'unit'",
    HEAD + "air_temperature_c = -300\n" + UNIT + HERE: "air_temperature_c is -300: it must be more than -273.15",
    HEAD + "air_temperature_c = nan\n" + UNIT + HERE: "air_temperature_c is nan: give a finite number",
    HEAD + "sensor = 3\n" + UNIT + HERE: "sensor is 3: make it a table",
    HEAD + "[sensor]\nbeam_width_deg = 0\n" + UNIT + HERE: r"\[sensor\]: beam_width_deg is 0: it must be more than 0",
    HEAD + "temperature = 3\n" + UNIT + HERE: r"temperature is not known here: .*known: air_temperature_c",
    HEAD + "[[unit]]\nserial = 1": r"\[\[unit\]\] 1: name is missing",
    HEAD
    + UNIT.replace("1", "true", 2).replace("utrue", "u1")
    + HERE: "'u1': serial is True: give a whole number from 0",
    HEAD + UNIT.replace('"/dev/ttyUSB0"', '""') + HERE: "'u1': address is ''",
    HEAD + UNIT: "'u1': pose or path, one of the two",
    HEAD + UNIT + HERE + "path = {}\n": "'u1': pose or path, one of the two",
    HEAD + UNIT + "pose = 'odometer'\n": "pose is 'odometer': make it a table",
    HEAD + UNIT + "pose = { x_m = 1, y_m = 2 }\n": "'u1'.pose: heading_deg is missing",
    HEAD + UNIT + "pose = { x_m = 'a', y_m = 2, heading_deg = 0 }\n": "'u1'.pose: x_m is 'a': give a finite number",
    HEAD + UNIT + 'pose = "key"\npose_sigma = { position_m = 1 }\n': "pose_sigma is not known here",
    HEAD + UNIT + HERE + "pose_sigma = { position_m = -1 }\n": "position_m is -1: it must be 0 or more",
    HEAD + UNIT + "path = {}\n": "'u1'.path: corners_m or waypoints, one of the two",
    HEAD + UNIT + "path = { waypoints = [[0, 0]] }\n": r"waypoints\[0\] is \[0, 0\]: give \[x_m, y_m, heading_deg\]",
    HEAD + UNIT + "path = { waypoints = [] }\n": "waypoints must be a list of at least 1",
    HEAD + UNIT + "path = { corners_m = [[0, 0], [0, 0]], spacing_m = 1 }\n": r"corners_m\[0\] is the same place",
    HEAD + UNIT + "path = { corners_m = [[0, 0], [1, 0]], spacing_m = 0 }\n": "spacing_m is 0: it must be more than 0",
    HEAD + UNIT + "path = { corners_m = [[0, 0], [1, 0]], spacing_m = 1e-9 }\n": "spacing_m is 1e-09: make it larger",
    HEAD + UNIT + HERE + "sweep = { count = 65 }\n": "'u1'.sweep: count is 65: give a whole number from 1 to 64",
    HEAD + UNIT + HERE + "sweep = { pings = 2 }\n": "'u1'.sweep: pings is 2: give 1, 3 or 5",
    HEAD + UNIT + HERE + "sweep = { start = 1 }\n": "start is 1: give true or false",
    HEAD + UNIT + HERE + "sweep = { cuont = 5 }\n": "cuont is not known here",
    HEAD + UNIT + HERE + UNIT + HERE: "'u1': name 'u1' is also that of 'u1'",
    HEAD + UNIT + HERE + UNIT.replace("u1", "u2") + HERE: "'u2': serial 1 is also that of 'u1'",
    HEAD + UNIT + HERE + UNIT.replace("1", "2") + HERE: "'u2': address '/dev/ttyUSB0' is also that of 'u1'",
}


@pytest.mark.parametrize(("text", "told"), MISTAKES.items(), ids=MISTAKES.values())
def test_a_mistake_is_told_by_file_table_and_field(tmp_path, text, told):
    with pytest.raises(SiteFileError, match=told) as error:
        load(tmp_path, text)
    assert str(error.value).startswith(str(tmp_path / "site.toml"))


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(SiteFileError, match=r"none\.toml can't be read: No such file"):
        site.load(tmp_path / "none.toml")
