"""A site file becomes a Site, or an error that tells its author what to change."""

import math

import pytest
from sdk.site_texts import HEAD, HERE, UNIT, load

from noctule import bounds, site
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


def test_a_unit_may_say_which_room_it_is_in(tmp_path):
    assert load(tmp_path, HEAD + UNIT + HERE + 'room = "kitchen"\n').unit("u1").room == "kitchen"
    assert load(tmp_path, HEAD + UNIT + HERE).unit("u1").room == ""


def test_what_is_left_out_stays_unknown_and_nothing_starts_by_itself(tmp_path):
    loaded = load(tmp_path, HEAD + UNIT + HERE)
    unit = loaded.unit("u1")
    assert (loaded.air_temperature_c, loaded.clock) == (None, "utc")
    assert (unit.sensor, unit.plan, unit.start, unit.pause_s) == (site.Sensor(), None, False, 0.0)
    assert not unit.sensor.message().HasField("beam_width_rad")
    # theory of tape measures: 1 to 5 cm, 1 to 5 degrees
    assert unit.pose == site.FixedPose(site.Pose2(1.0, 2.0, math.pi / 2, 0.03, math.radians(3)))


@pytest.mark.parametrize(
    ("pose", "sigmas"),
    [
        ("pose = { x_m = 1, y_m = 2, heading_deg = 90, sigma_position_m = 0.01, sigma_heading_deg = 1 }", (0.01, 1)),
        ("pose = { x_m = 1, y_m = 2, heading_deg = 90, sigma_position_m = 0 }", (0, 3)),
        (
            "pose = { x_m = 1, y_m = 2, heading_deg = 90 }\npose_sigma = { position_m = 0.01, heading_deg = 1 }",
            (0.01, 1),
        ),
        ("pose = { x_m = 1, y_m = 2, heading_deg = 90 }\npose_sigma = { heading_deg = 0 }", (0.03, 0)),
    ],
)
def test_a_fixed_pose_has_the_errors_that_it_states_and_a_tape_measures_for_the_others(tmp_path, pose, sigmas):
    source = load(tmp_path, HEAD + UNIT + pose + "\n").unit("u1").pose
    assert source == site.FixedPose(site.Pose2(1.0, 2.0, math.pi / 2, sigmas[0], math.radians(sigmas[1])))


def test_a_pose_to_be_found_states_the_largest_error_that_a_message_may_hold(tmp_path):
    source = load(tmp_path, HEAD + UNIT + 'pose = "unknown"\n').unit("u1").pose
    assert isinstance(source, site.UnknownPose)
    assert source.message().sigma_position_m == bounds.number("Pose", "sigma_position_m").most
    bounds.check(source.message())


def test_a_tracked_unit_has_its_pose_on_the_bus(tmp_path):
    assert load(tmp_path, HEAD + UNIT + 'pose = "key"\n').unit("u1").pose == site.PoseKey()


def test_an_unknown_unit_is_told_with_the_known_ones(tmp_path):
    with pytest.raises(SiteFileError, match="no unit 'u9': it has u1"):
        load(tmp_path, HEAD + UNIT + HERE).unit("u9")


def test_a_byte_order_mark_is_read_over(tmp_path):
    path = tmp_path / "site.toml"
    path.write_text(HEAD + UNIT + HERE, encoding="utf-8-sig")
    assert site.load(path).name == "room"


@pytest.mark.parametrize(
    "address", ["socket://h:1", "socket://[::1]:65535", "rfc2217://h:7?ign_set_control", "/dev/serial/by-id/usb-FTDI:1"]
)
def test_an_address_that_a_gateway_can_open_is_taken_as_it_is(tmp_path, address):
    unit = UNIT.replace("/dev/ttyUSB0", address)
    assert load(tmp_path, HEAD + unit + HERE).unit("u1").address == address


def test_the_edges_of_the_bounds_are_allowed(tmp_path):
    """-148 degrees and 65.535 s are the unit's own limits (firmware/README.md, CONFIGURE and START)."""
    edges = (
        "pose = { x_m = -1e4, y_m = 1e4, heading_deg = -360 }\npose_sigma = { position_m = 100, heading_deg = 180 }\n"
        "sweep = { first_bearing_deg = -148, count = 64, pause_s = 65.535, ping_interval_s = 0.029 }\n"
        "sensor = { beam_width_deg = 0.1, range_sigma_m = 0.5, range_bias_m = -1, "
        "face_offset_m = -0.2, face_offset_sigma_m = 0.1 }\n"
    )
    unit = load(tmp_path, HEAD + UNIT + edges).unit("u1")
    assert unit.plan is not None
    bounds.check(unit.plan)
    bounds.check(unit.sensor.message())
    assert isinstance(unit.pose, site.FixedPose)
    bounds.check(unit.pose.pose.message())


def test_each_unit_has_the_face_offset_of_its_own_sensor_or_else_the_sites(tmp_path):
    site_wide = "[sensor]\nface_offset_m = 0.02\nface_offset_sigma_m = 0.003\n"
    others = "".join(
        UNIT.replace("u1", f"u{n}").replace("serial = 1", f"serial = {n}").replace("USB0", f"USB{n}") + HERE + own
        for n, own in ((2, "sensor = { face_offset_m = 0.012 }\n"), (3, "sensor = { face_offset_sigma_m = 0.001 }\n"))
    )
    loaded = load(tmp_path, HEAD + site_wide + UNIT + HERE + others)
    stated = [(unit.sensor.message().face_offset_m, unit.sensor.face_offset_sigma_m) for unit in loaded.units]
    # The second unit's own offset is exact: the site's error is that of another.
    assert stated == [(0.02, 0.003), (0.012, None), (0.02, 0.001)]
