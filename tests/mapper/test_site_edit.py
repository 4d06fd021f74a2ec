"""A calibration written into a site file: only the sensor's fields change, however the file is laid out."""

import tomllib

import pytest

from noctule import site
from noctule_mapper.calibration.sensor_files import write_into_site
from noctule_mapper.calibration.site_edit import Edit, edited, write_edits

FIELDS = {"range_bias_m": -0.0021, "range_sigma_m": 0.003123}
SENSOR = [Edit(None, "sensor", FIELDS)]
UNIT = '[[unit]] # first\nname = "u1"\nserial = 1\naddress = "a"\npose = "key"\n'
OTHER = '\n# second\n[[unit]]\nname = "u2"\nserial = 2\naddress = "b"\npose = "key"\n'
FILES = {
    "no sensor": 'site = "a"\n' + UNIT + OTHER,
    "both fields": 'site = "a"\n[sensor] # s\nrange_sigma_m = 0.1 # x\nrange_bias_m = 1   # y\n\n# z\n' + UNIT + OTHER,
    "one field": 'site = "a"\n[sensor]\nbeam_width_deg = 22.5\n\n# next\n' + UNIT + OTHER,
    "dotted keys": 'site = "a"\nsensor.beam_width_deg = 22.5 # w\n' + UNIT + OTHER,
    "inline": 'site = "a"\nsensor = { range_sigma_m = 0.1 } # s\n' + UNIT + OTHER,
    "a unit's table": 'site = "a"\n'
    + UNIT
    + "[unit.sensor]\nrange_sigma_m = 0.1 # x\n[unit.sweep]\ncount = 3\n"
    + OTHER,
    "a unit's inline": 'site = "a"\n'
    + UNIT
    + "sensor = { range_sigma_m = 0.1 } # s\n[unit.sweep]\ncount = 3\n"
    + OTHER,
    "a unit's dotted": 'site = "a"\n' + UNIT + "sensor.range_sigma_m = 0.1 # s\n" + OTHER,
    "inline units": 'site = "a"\nunit = [{ name = "u1", serial = 1, address = "a", pose = "key" }] # all\n',
    "no last newline": ('site = "a"\n' + UNIT)[:-1],
}


@pytest.mark.parametrize("text", FILES.values(), ids=FILES.keys())
@pytest.mark.parametrize("unit", [None, "u1"])
def test_only_the_sensors_fields_change(tmp_path, text, unit):
    file = tmp_path / "site.toml"
    file.write_text(text)
    before = tomllib.loads(text)
    after = write_into_site(file, FIELDS, unit)
    sensor = tomllib.loads(text)["unit"][0].get("sensor", {}) if unit is None else FIELDS
    assert after.unit("u1").sensor.range_sigma_m == sensor.get("range_sigma_m", FIELDS["range_sigma_m"])
    holder = before if unit is None else before["unit"][0]
    holder["sensor"] = holder.get("sensor", {}) | FIELDS
    assert tomllib.loads(file.read_text()) == before
    assert after == site.load(file)


@pytest.mark.parametrize("text", FILES.values(), ids=FILES.keys())
def test_every_line_without_a_sensors_field_stays(text):
    was = [
        line for line in text.splitlines() if "sensor" not in line and "range_" not in line and "unit = [" not in line
    ]
    new = edited(text, SENSOR).splitlines()
    assert [line for line in new if line in was and line] == [line for line in was if line]


def test_a_comment_behind_a_value_stays_with_it():
    new = edited(FILES["both fields"], SENSOR)
    assert "[sensor] # s\nrange_sigma_m = 0.003123 # x\nrange_bias_m = -0.0021   # y\n\n# z\n" in new


def test_a_new_field_goes_before_the_comment_of_the_next_table():
    new = edited(FILES["one field"], SENSOR)
    assert "beam_width_deg = 22.5\nrange_bias_m = -0.0021\nrange_sigma_m = 0.003123\n\n# next\n" in new


def test_a_file_with_windows_line_ends_keeps_them():
    new = edited(FILES["one field"].replace("\n", "\r\n"), SENSOR)
    assert new == edited(FILES["one field"], SENSOR).replace("\n", "\r\n")


def test_a_byte_order_mark_stays(tmp_path):
    file = tmp_path / "site.toml"
    file.write_text(FILES["one field"], encoding="utf-8-sig")
    write_into_site(file, FIELDS, None)
    assert file.read_text(encoding="utf-8-sig") == edited(FILES["one field"], SENSOR)
    assert file.read_bytes().startswith(b"\xef\xbb\xbfsite")


def test_a_file_is_replaced_with_its_rights_and_through_its_link(tmp_path):
    file, link = tmp_path / "real.toml", tmp_path / "site.toml"
    file.write_text(FILES["one field"])
    file.chmod(0o640)
    link.symlink_to(file)
    write_into_site(link, FIELDS, None)
    assert link.is_symlink()
    assert file.stat().st_mode & 0o777 == 0o640
    assert site.load(file).unit("u1").sensor.range_sigma_m == FIELDS["range_sigma_m"]


POSE = {"x_m": 1.25, "y_m": -0.5, "heading_deg": 91.5, "sigma_position_m": 0.005}
POSES = {
    "a table in a line": "pose = { x_m = 1, y_m = 2, heading_deg = 90 } # by tape\n",
    "a table of its own": "[unit.pose] # by tape\nx_m = 1 # x\ny_m = 2\nheading_deg = 90\n",
    "dotted keys": "pose.x_m = 1 # x\npose.y_m = 2\npose.heading_deg = 90\n",
    "unknown": 'pose = "unknown" # to be found\n',
}


@pytest.mark.parametrize("pose", POSES.values(), ids=POSES.keys())
def test_a_pose_is_written_over_the_one_that_is_there_and_nothing_else_changes(tmp_path, pose):
    file = tmp_path / "site.toml"
    unit = UNIT.replace('pose = "key"\n', "") + pose
    file.write_text('site = "a"\n' + unit + OTHER)
    after = write_edits(file, [Edit("u1", "pose", POSE)])
    source = after.unit("u1").pose
    assert isinstance(source, site.FixedPose)
    assert (source.pose.x_m, source.pose.y_m, source.pose.sigma_position_m) == (1.25, -0.5, 0.005)
    assert [line for line in file.read_text().splitlines() if "u2" in line or "second" in line] == [
        "# second",
        'name = "u2"',
    ]
    comment = pose[pose.index("#") : pose.index("\n")]
    assert comment in file.read_text()
