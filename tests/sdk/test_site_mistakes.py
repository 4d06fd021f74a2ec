"""Mistakes in a site file: each is named by file, line, table and field, and all at once."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sdk.site_texts import HEAD, HERE, UNIT, load

from noctule import site
from noctule.errors import SiteFileError

MISTAKES = {
    "": "site is missing: add it",
    "site = 'r'": "unit is missing",
    "site = ": "not a TOML file",
    "site = '*'\n" + UNIT + HERE: "site is wrong: '\\*' stands for all names",
    "site = 'Room'\n" + UNIT + HERE: "site is wrong: the name 'Room'.*lower-case",
    HEAD + "unit = []\n": "unit must be an array of tables",
    HEAD + "clock = 'gps'\n" + UNIT + HERE: "clock is 'gps': choose 'utc' or 'unit'",
    HEAD + "air_temperature_c = -300\n" + UNIT + HERE: "air_temperature_c is -300: give -60 to 85 degrees C",
    HEAD + "air_temperature_c = nan\n" + UNIT + HERE: "air_temperature_c is nan: give a finite number",
    HEAD + "sensor = 3\n" + UNIT + HERE: "sensor is 3: make it a table",
    HEAD + "[sensor]\nbeam_width_deg = 0\n" + UNIT + HERE: r"\[sensor\]: beam_width_deg is 0: give 0.1 to 180 degrees",
    HEAD + "temperature = 3\n" + UNIT + HERE: r"temperature is not known here: did you mean air_temperature_c\?",
    HEAD + "[[unit]]\nserial = 1": r"\[\[unit\]\] 1: name is missing",
    HEAD
    + UNIT.replace("1", "true", 2).replace("utrue", "u1")
    + HERE: "'u1': serial is True: give a whole number from 0",
    HEAD + UNIT.replace('"/dev/ttyUSB0"', '""') + HERE: "'u1': address is ''",
    HEAD + UNIT: "'u1': pose or path, one of the two",
    HEAD + UNIT + HERE + "path = {}\n": "'u1': pose or path, one of the two",
    HEAD + UNIT + HERE + "room = 3\n": "'u1': room is 3",
    HEAD + UNIT + "pose = 'odometer'\n": "pose is 'odometer': make it a table",
    HEAD + UNIT + "pose = { x_m = 1, y_m = 2 }\n": "'u1'.pose: heading_deg is missing",
    HEAD + UNIT + "pose = { x_m = 'a', y_m = 2, heading_deg = 0 }\n": "'u1'.pose: x_m is 'a': give a finite number",
    HEAD + UNIT + "pose = 'unknwon'\n": '\'unknwon\': make it a table, .*or give "unknown" or "key"',
    HEAD + UNIT + 'pose = "key"\npose_sigma = { position_m = 1 }\n': "pose_sigma is not known here",
    HEAD + UNIT + 'pose = "unknown"\npose_sigma = { position_m = 1 }\n': "pose_sigma is not known here",
    HEAD
    + UNIT
    + HERE.replace("90", "90, sigma_position_m = 101"): r"'u1'.pose: sigma_position_m is 101: give 0 to 100 m",
    HEAD + UNIT + HERE.replace("90", "90, sigma_heading_deg = 'a'"): "'u1'.pose: sigma_heading_deg is 'a': give a",
    HEAD
    + UNIT
    + HERE.replace("90", "90, sigma_position_m = 0.1")
    + "pose_sigma = { heading_deg = 1 }\n": r"'u1': pose_sigma says what pose says too .*: remove it",
    HEAD + UNIT + HERE + "pose_sigma = { position_m = -1 }\n": "position_m is -1: give 0 to 100 m",
    HEAD + UNIT + "path = {}\n": "'u1'.path: corners_m or waypoints, one of the two",
    HEAD + UNIT + "path = { waypoints = [[0, 0]] }\n": r"waypoints\[0\] is \[0, 0\]: give \[x_m, y_m, heading_deg\]",
    HEAD + UNIT + "path = { waypoints = [] }\n": "waypoints must be a list of at least 1",
    HEAD + UNIT + "path = { corners_m = [[0, 0], [0, 0]], spacing_m = 1 }\n": r"corners_m\[0\] is the same place",
    HEAD + UNIT + "path = { corners_m = [[0, 0], [1, 0]], spacing_m = 0 }\n": "spacing_m is 0: give 0.001 to 10000 m",
    HEAD + UNIT + "path = { corners_m = [[0, 0], [1, 0]], spacing_m = 1e-9 }\n": "spacing_m is 1e-09: give 0.001 to",
    HEAD
    + UNIT
    + "path = { corners_m = [[0, 0], [100, 0]], spacing_m = 0.001 }\n": "spacing_m is 0.001: make it larger",
    HEAD + UNIT + HERE + "sweep = { count = 65 }\n": "'u1'.sweep: count is 65: give a whole number from 1 to 64",
    HEAD + UNIT + HERE + "sweep = { pings = 2 }\n": "'u1'.sweep: pings is 2: give 1, 3 or 5",
    HEAD + UNIT + HERE + "sweep = { start = 1 }\n": "start is 1: give true or false",
    HEAD + UNIT + HERE + "sweep = { cuont = 5 }\n": r"cuont is not known here: did you mean count\?",
    HEAD
    + UNIT
    + HERE
    + "sweep = { zeal = 5 }\n": r"zeal is not known here: correct or remove it \(known: bearing_step",
    HEAD + UNIT.replace("serial", "seriel") + HERE: r"'u1': serial is missing: add it \(did you write it as seriel\?",
    HEAD + UNIT.replace("[[unit]]", "[[units]]") + HERE: r"unit is missing: add it \(did you write it as units\?",
    HEAD + UNIT + "psoe = { x_m = 1, y_m = 2, heading_deg = 0 }\n": r"pose or path.*did you write it as psoe\?",
    HEAD + "air_temperature_c = 294\n" + UNIT + HERE: r"air_temperature_c is 294: .*in degrees Celsius, not kelvin",
    HEAD
    + f"air_temperature_c = 1{'0' * 400}\n"
    + UNIT
    + HERE: r"air_temperature_c is 10{79}\.\.\.: give a finite number$",
    HEAD + f"air_temperature_c = 0x{'f' * 5000}\n" + UNIT + HERE: "is a number of thousands of digits: give a finite",
    HEAD + UNIT.replace("u1", "../u1") + HERE: "name is wrong: the name '../u1' can't be part of a key: use lower-case",
    HEAD + "[sensor]\nbeam_width_deg = 400\n" + UNIT + HERE: r"\[sensor\]: beam_width_deg is 400: .*the full width",
    HEAD + "[sensor]\nrange_bias_m = 2.3\n" + UNIT + HERE: r"range_bias_m is 2.3: give -1 to 1 m \(in metres\)",
    HEAD + UNIT + HERE + "sensor = { face_offset_m = 2.0 }\n": r"'u1'.sensor: face_offset_m is 2.0: give -0.2 to 0.2 m",
    HEAD
    + UNIT
    + HERE
    + "sensor = { face_offset_sigma_m = 0.002 }\n": "face_offset_sigma_m has no face_offset_m beside it",
    HEAD + UNIT + HERE + "sensor = { range_sigma_m = 3.2 }\n": r"'u1'.sensor: range_sigma_m is 3.2: .*\(in metres\)",
    HEAD + UNIT + HERE + "sweep = { pause_s = 70 }\n": r"'u1'.sweep: pause_s is 70: give 0 to 65.535 s \(in seconds\)",
    HEAD
    + UNIT
    + HERE
    + "sweep = { ping_interval_s = 60 }\n": r"ping_interval_s is 60: give 0.029 to 1 s \(in seconds\)",
    HEAD + UNIT + HERE + "sweep = { first_bearing_deg = 200 }\n": "first_bearing_deg is 200: give -148 to 148 degrees",
    HEAD + UNIT + HERE.replace("90", "9000"): "'u1'.pose: heading_deg is 9000: give -360 to 360 degrees",
    HEAD + UNIT + HERE.replace("1,", "1e6,"): r"'u1'.pose: x_m is 1000000.0: give -10000 to 10000 m \(in metres",
    HEAD + UNIT + HERE + "pose_sigma = { heading_deg = 200 }\n": "heading_deg is 200: give 0 to 180 degrees",
    HEAD
    + UNIT
    + "path = { waypoints = [[0, 0, 0], [0, 1e7, 0]] }\n": r"waypoints\[1\], y_m, is 10000000.0: give -10000",
    HEAD + UNIT + "path = { waypoints = [[0, 0, 720]] }\n": r"waypoints\[0\], heading_deg, is 720: give -360 to 360",
    HEAD + UNIT + "path = { corners_m = [[0, 0], [1e308, 0]], spacing_m = 1 }\n": r"corners_m\[1\], x_m, is 1e\+308",
    HEAD
    + UNIT.replace("/dev/ttyUSB0", "sockt://h:1")
    + HERE: r"sockt:// is not known, give socket://HOST:PORT, rfc2217",
    HEAD
    + UNIT.replace("/dev/ttyUSB0", "socket://h:70000")
    + HERE: "'socket://h:70000': Port out of range 0-65535; give",
    HEAD + UNIT.replace("/dev/ttyUSB0", "socket://h:0") + HERE: "the port from 1 to 65535; give",
    HEAD + UNIT.replace("/dev/ttyUSB0", "rfc2217://h") + HERE: "host and port must both be there",
    HEAD + UNIT.replace("/dev/ttyUSB0", "socket://:7101") + HERE: "host and port must both be there",
    HEAD + UNIT.replace("/dev/ttyUSB0", "localhost:7101") + HERE: "'localhost:7101': give socket://HOST:PORT",
    HEAD.replace("room", "x" * 65) + UNIT + HERE: "the name 'x{64}'... is too long for a key: 64 characters",
    HEAD + UNIT + HERE + UNIT + HERE: "'u1': name 'u1' is also that of 'u1'",
    HEAD + UNIT + HERE + UNIT.replace("u1", "u2") + HERE: "'u2': serial 1 is also that of 'u1'",
    HEAD + UNIT + HERE + UNIT.replace("1", "2") + HERE: "'u2': address '/dev/ttyUSB0' is also that of 'u1'",
}


@pytest.mark.parametrize(("text", "told"), MISTAKES.items(), ids=MISTAKES.values())
def test_a_mistake_is_told_by_file_table_and_field(tmp_path, text, told):
    with pytest.raises(SiteFileError, match=told) as error:
        load(tmp_path, text)
    assert str(error.value).startswith(str(tmp_path / "site.toml"))


LONG = """site = "room"
[sensor]
range_sigma_m = 3.2

[[unit]]
name = "u1"
serial = 1
address = "/dev/ttyUSB0"
pose = { x_m = 1, y_m = 1, heading_deg = 90 }

[[unit]]
name = "u2"
serial = 2
address = "/dev/ttyUSB1"
[unit.pose]
x_m = 1
y_m = 1
heading_deg = 90
[unit.sweep]
pause_s = 5
"""

SEVERAL = """site = "room"
colck = "utc"
air_temperature_c = 294
[sensor]
range_sigma_m = 3.2

[[unit]]
name = "u1"
seriel = 1
address = "sockt://h:1"
pose = { x_m = 1, heading_deg = 900 }
sweep = { pause_s = 70, pings = 2 }

[[unit]]
name = "*"
serial = "2"
path = { corners_m = [[0, 0], [1, 2, 3]], spacing = 0.2 }
sensor = 3
"""


def test_all_mistakes_are_told_at_once_in_the_order_of_the_file(tmp_path):
    with pytest.raises(SiteFileError) as error:
        load(tmp_path, SEVERAL)
    told = [line.removeprefix(f"{tmp_path}/site.toml, ") for line in str(error.value).splitlines()]
    beginnings = [
        "line 2: colck is not known here: did you mean clock?",
        "line 3: air_temperature_c is 294: give",
        "line 5: [sensor]: range_sigma_m is 3.2: give",
        "line 7: [[unit]] 'u1': serial is missing: add it (did you write it as seriel?)",
        "line 10: [[unit]] 'u1': address is 'sockt://h:1': sockt:// is not known",
        "line 11: [[unit]] 'u1'.pose: heading_deg is 900: give",
        "line 11: [[unit]] 'u1'.pose: y_m is missing: add it",
        "line 12: [[unit]] 'u1'.sweep: pause_s is 70: give",
        "line 12: [[unit]] 'u1'.sweep: pings is 2: give 1, 3 or 5",
        "line 14: [[unit]] 2: address is missing: add it",
        "line 15: [[unit]] 2: name is wrong: '*' stands",
        "line 16: [[unit]] 2: serial is '2': give a whole number",
        "line 17: [[unit]] 2.path: corners_m[1] is [1, 2, 3]: give [x_m, y_m]",
        "line 17: [[unit]] 2.path: spacing_m is missing: add it (did you write it as spacing?)",
        "line 18: [[unit]] 2: sensor is 3: make it a table",
    ]
    assert len(told) == len(beginnings), told
    for line, beginning in zip(sorted(told), sorted(beginnings), strict=True):
        assert line.startswith(beginning)
    numbers = [int(line.split(":")[0].removeprefix("line ")) for line in told]
    assert numbers == sorted(numbers)


@pytest.mark.parametrize(("count", "last"), [(500, "and 480 more mistakes"), (21, "and 1 more mistake")])
def test_a_file_of_very_many_mistakes_fills_one_screen(tmp_path, count, last):
    with pytest.raises(SiteFileError) as error:
        load(tmp_path, HEAD + UNIT + f"path = {{ waypoints = [{'[0, 0, 720], ' * count}] }}\n")
    lines = str(error.value).splitlines()
    assert len(lines) == 21
    assert lines[-1].endswith(last)


def test_every_unit_that_has_something_of_another_is_told(tmp_path):
    with pytest.raises(SiteFileError) as error:
        load(tmp_path, HEAD + 3 * (UNIT + HERE))
    assert len(str(error.value).splitlines()) == 2 * 3  # name, serial number and address, of two units
    assert "line 9: [[unit]] 'u1': serial 1 is also that of 'u1': change one" in str(error.value)


@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ("3.2", "3.2", r"line 3: \[sensor\]: range_sigma_m is 3.2: give 0.0001 to 0.5 m"),
        ("serial = 2", "seriel = 2", r"line 11: \[\[unit\]\] 'u2': serial is missing: .*did you write it as seriel\?"),
        ("y_m = 1, heading_deg = 90", "y_m = 1", r"line 9: \[\[unit\]\] 'u1'.pose: heading_deg is missing"),
        ("heading_deg = 90\n", "heading_deg = 900\n", r"line 18: \[\[unit\]\] 'u2'.pose: heading_deg is 900"),
        ("pause_s = 5", "pause_s = 70", r"line 20: \[\[unit\]\] 'u2'.sweep: pause_s is 70: give 0 to 65.535 s"),
        ("pause_s = 5", "pausse_s = 5", r"line 20: .*pausse_s is not known here: did you mean pause_s\?"),
    ],
)
def test_a_mistake_is_told_by_its_line_with_any_end_of_lines(tmp_path, line_end, right, wrong, told):
    text = LONG if right == wrong else LONG.replace("3.2", "0.003").replace(right, wrong)
    path = tmp_path / "site.toml"
    path.write_bytes(text.replace("\n", line_end).encode())
    with pytest.raises(SiteFileError, match=told):
        site.load(path)


def _spoiled(text, data):
    """A site file with some of its characters removed, doubled or exchanged."""
    for _ in range(data.draw(st.integers(0, 4))):
        at = data.draw(st.integers(0, len(text)))
        to = data.draw(st.integers(at, min(at + 12, len(text))))
        text = (
            text[:at]
            + data.draw(st.text("[]{}=\"'.,\n#-9e\ufeff\u00e9\0x", max_size=3) | st.just(text[at:to] * 2))
            + text[to:]
        )
    return text.encode(errors="replace")


@given(st.data())
def test_whatever_a_site_file_holds_it_is_read_or_refused_by_name(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "any-site.toml"
    path.write_bytes(data.draw(st.binary(max_size=200)) if data.draw(st.integers(0, 5)) == 0 else _spoiled(LONG, data))
    try:
        site.load(path)
    except SiteFileError as error:
        assert str(error).startswith(str(path))


def test_a_file_of_a_thousand_brackets_is_refused(tmp_path):
    with pytest.raises(SiteFileError, match="is not a TOML file"):
        load(tmp_path, "site = " + "[" * 100_000)


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(SiteFileError, match=r"none\.toml can't be read: No such file"):
        site.load(tmp_path / "none.toml")
