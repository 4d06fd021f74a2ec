"""What other scanners write becomes a survey, and what can't become one is refused by file, line, column and value."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from sdk.scanned import AIR_C, imported

from noctule.errors import ScanError
from noctule.messages_pb2 import READING_STATUS_ECHO, READING_STATUS_NO_ECHO
from noctule.scans.importing import ImportedScan
from noctule.scans.options import Columns

C_M_S = 331.3 + 0.606 * AIR_C  # 343.42


def flat(scan: ImportedScan) -> list[tuple[float, float | None]]:
    """Each reading's bearing in whole degrees and range in millimetres, None where nothing was heard."""
    return [
        (
            round(math.degrees(reading.bearing_rad)),
            round(reading.time_of_flight_s * C_M_S / 2 * 1e3) if reading.HasField("time_of_flight_s") else None,
        )
        for sweep in scan.sweeps
        for reading in sweep.readings
    ]


BY_NUMBER: dict[str, Any] = {"columns": Columns("1", "2")}

THREE = [(10, 1205), (11, 1210), (12, 1230)]


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("angle,range\n10,120.5\n11,121\n12,123\n", {}),
        ("10,120.5\n11,121\n12,123\n", BY_NUMBER),
        ("10;120,5\n11;121\n12;123\n", BY_NUMBER),
        ("10\t120,5\n11\t121\n12\t123", BY_NUMBER),
        ("10 120.5\n11   121\n  12 123\n", BY_NUMBER),
        ("10 120,5\n11 121,0\n12 123,0\n", BY_NUMBER),
        ('"10","120,5"\n"11","121"\n"12","123"\n', BY_NUMBER),
        ("\ufeffAngle , Range\r\n10,120.5\r\n\r\n# a comment\r\n11,121\r\n12,123\r\n", {}),
        ("\ufeffangle,range\n10,120.5\n11,121\n12,123\n".encode("utf-16-le"), {}),
        (b"angle,range\n10,120.5\n11,121\n12,123\n" + b"\0" * 40, {}),
        ("t,range,angle\n1,120.5,10\n2,121,11\n3,123,12\n", {"columns": Columns("3", "2")}),
        ("Radar ready\nangle,range\n10,120.5\n11,121\nangle,range\n12,123\n", {}),
        ("angle,distance (mm)\n10,1205\n11,1210\n12,1230\n", {"columns": Columns("angle", "2"), "units": None}),
        ("angle,range_m\n10,1.205\n11,1.21\n12,1.23\n", {"columns": Columns("angle", "range_m"), "units": None}),
        ("10°,120.5 cm\n11°,121 cm\n12°,123 cm\n".encode("latin-1"), BY_NUMBER | {"units": None}),
        ("Angle: 10, Range: 120.5 cm\nAngle: 11, Range: 121 cm\nAngle: 12, Range: 123 cm\n", {}),
        ("angle:10\trange:120.5\nangle:11\trange:121\nangle:12\trange:123\n", {}),
        ("12:30:05.123 -> 10,120.5\n12:30:05.200 -> 11,121\n12:30:05.300 -> 12,123\n", BY_NUMBER),
        ("10,1205.11,1210.12,1230.", BY_NUMBER | {"units": "mm"}),
        ("10*120.5#11*121#12*123#", BY_NUMBER),
        ('{"angle": 10, "range": 120.5}\n{"range": 121, "angle": 11}\n{"Angle": 12, "range": 123}\n', {}),
        ("-10,120.5\n-11,121\n-12,123\n", BY_NUMBER | {"clockwise": True}),
        ("80,120.5\n79,121\n78,123\n", BY_NUMBER | {"clockwise": True, "forward_deg": 90.0}),
        ("angle,range\n0.174533,120.5\n0.191986,121\n0.209440,123\n", {"angle_units": "rad"}),
        ("10,47.440945\n11,47.637795\n12,48.425197\n", BY_NUMBER | {"units": "in"}),
    ],
)
def test_the_same_three_readings_in_every_way_that_scanners_write_them(tmp_path, text, options) -> None:
    assert flat(imported(tmp_path, text, **options)) == THREE


@pytest.mark.parametrize(
    ("text", "options", "place", "column", "said"),
    [
        ("angle,range\n1,2\n3,x\n", {}, "line 3", "range", "'x', which is no figure: give --no-echo x"),
        ("angle,range\n1,2\n3,\n", {}, "line 3", "range", "is empty: give --no-echo empty"),
        ("angle,range\n1,2\n3\n4,5\n", {}, "line 3", "range", "is not there"),
        ("angle,range\n1,2\nx,4\n", {}, "line 3", "angle", "'x', which is no figure: correct the line"),
        ("angle,range\n1,2\n3,1e999\n", {}, "line 3", "range", "'1e999', which is no figure"),
        ("angle,range\n1,2\n3,-4\n", {}, "line 3", "range", "'-4': give 0 to 77269.5 cm"),
        ("angle,range\n1,2\n3,78000\n", {}, "line 3", "range", "or name it with --no-echo or --no-echo-above"),
        ("angle,range\n1,2\n361,4\n", {}, "line 3", "angle", "'361': give -360 to 360 degrees"),
        ("angle,range\n1,2\n3,4 mm\n", {}, "line 3", "range", "'4 mm', but the column's figures are read in another"),
        ("angle,range\n1,2\n", {"columns": Columns("angle", "distance")}, "", "", "no line names the columns"),
        ("angel,range\n1,2\n", {}, "", "", "did you mean 'angel'?"),
        ("angle,range\n1,2\n", {"units": None}, "", "range", "does not say in which unit its ranges are"),
        ("a,b\nc,d\n", BY_NUMBER, "line 2", "", "no figures in the columns asked for"),
        ("", {}, "", "", "holds no readings: it is empty"),
        ("# nothing\n\n", {}, "", "", "holds no readings"),
        (b"\x89PNG\r\n\x1a\n\x00\x01", {}, "", "", "is not text (byte 8)"),
        ('{"angle": 1, "range": 2}\n{"angle": 1\n{}\n', {}, "line 2", "", "is no JSON"),
        ('[{"angle": 1, "range": 2}]\n', {}, "line 1", "", "give one object on each line"),
        ('{"angle": 1, "range": 2}\n{"angle": [1], "range": 2}\n', {}, "line 2", "angle", "[1], which is no figure"),
        (
            '{"angle": 1, "range": 2}\n{"range": 2}\n',
            {},
            "line 2",
            "angle",
            "is not there (the line has the columns range)",
        ),
        ('{"site": "a", "readings": []}\n', {}, "line 1", "", "this is a survey already"),
        ("angle,range,t\n1,2,0\n", {"columns": Columns("angle", "range", time="t")}, "", "t", "give --time-units"),
        (
            "angle,range,t_s\n1,2,0\n2,2,noon\n",
            {"columns": Columns("angle", "range", time="t_s")},
            "line 3",
            "t_s",
            "'noon', which is no figure",
        ),
        (
            "angle,range,x_m,y_m\n1,2,0,0\n2,2,0,20000\n",
            {"columns": Columns("angle", "range", x="x_m", y="y_m")},
            "line 3",
            "y_m",
            "'20000': give -10000 to 10000 m",
        ),
        ("10,20.11,21.12,22.13,x.14,24.15,25.", BY_NUMBER, "line 1, reading 4", "1", "'13,x', which is no figure"),
    ],
)
def test_what_can_not_be_read_is_refused_by_its_place_and_value(tmp_path, text, options, place, column, said) -> None:
    with pytest.raises(ScanError) as refused:
        imported(tmp_path, text, **options)
    assert refused.value.file == tmp_path / "scan.csv"
    assert (refused.value.place, refused.value.column) == (place, column)
    assert said in str(refused.value)
    where = ", ".join(filter(None, [str(tmp_path / "scan.csv"), place, column and f"column {column!r}"]))
    assert str(refused.value).startswith(where + ": ")


@pytest.mark.parametrize(
    "text", ["angle,range\n1,20\n2,21\n3", "1,20.2,21.3,", '{"angle":1,"range":20}\n{"angle":2,"range":21}\n{"an']
)
def test_a_last_line_that_was_cut_is_left_out_and_named(tmp_path, text) -> None:
    options = {} if "angle" in text else BY_NUMBER
    scan = imported(tmp_path, text, **options)
    assert flat(scan) == [(1, 200), (2, 210)]
    assert "left out, no reading" in scan.notes[0]


def test_bad_lines_are_left_out_and_counted_where_that_was_asked_for(tmp_path) -> None:
    text = "angle,range\n1,20\nScanning...\n2,21\n3,\n4,23\n"
    scan = imported(tmp_path, text, skip_bad_lines=True)
    assert flat(scan) == [(1, 200), (2, 210), (4, 230)]
    assert scan.notes[0].startswith("2 lines (line 3, line 5) were left out")


def test_named_values_and_all_beyond_a_limit_mean_that_nothing_was_heard(tmp_path) -> None:
    text = "angle,range\n1,20\n2,0\n3,797\n4,797.0\n5,nan\n6,\n7,401\n"
    scan = imported(tmp_path, text, no_echo=("0", "797", "NaN", "empty"), no_echo_above=400.0)
    assert flat(scan) == [(1, 200), *((angle, None) for angle in range(2, 8))]
    statuses = [reading.status for reading in scan.sweeps[0].readings]
    assert statuses == [READING_STATUS_ECHO] + [READING_STATUS_NO_ECHO] * 6
    assert (scan.echoes, scan.readings) == (1, 7)


@pytest.mark.parametrize(
    ("ranges", "hint"),
    [
        ([100, 110, 797, 120, 797, 797], "--no-echo 797"),
        ([100, 110, 0, 120], "--no-echo 0"),
        ([0, 110, 797, 120, 797, 797], "--no-echo 0,797"),
        ([30] * 8 + [100, 110, 120, 500], "--no-echo 30"),
        ([1, 1.2, 1.4], "the median range is 0.012 m: are the ranges really in cm?"),
        ([1000, 1010, 1021], "the median range is 10.1 m"),
    ],
)
def test_a_scan_that_looks_wrong_says_which_option_sets_it_right(tmp_path, ranges, hint) -> None:
    text = "angle,range\n" + "".join(f"{10 * index},{value}\n" for index, value in enumerate(ranges))
    assert any(hint in note for note in imported(tmp_path, text).notes)


def test_time_outs_do_not_make_the_unit_look_wrong(tmp_path) -> None:
    (note,) = imported(tmp_path, "angle,range\n10,0\n20,0\n30,0\n40,150\n").notes
    assert note.startswith("0 (75% of the readings) stands out")


def test_a_wall_heard_over_a_tenth_of_the_angles_at_one_whole_centimetre_is_no_time_out(tmp_path) -> None:
    ranges = [150 + index for index in range(70)] + [150] * 20 + [220 + index for index in range(91)]
    text = "angle,range\n" + "".join(f"{index},{value}\n" for index, value in enumerate(ranges))
    assert imported(tmp_path, text).notes == []


def sweep_angles(scan: ImportedScan) -> list[list[int]]:
    return [[round(math.degrees(reading.bearing_rad)) for reading in sweep.readings] for sweep in scan.sweeps]


def of_angles(folder: Path, angles: Sequence[float], **options) -> ImportedScan:
    return imported(folder, "angle,range\n" + "".join(f"{angle},100\n" for angle in angles), **options)


UP, DOWN = list(range(0, 181, 5)), list(range(180, -1, -5))


@pytest.mark.parametrize(
    "passes",
    [
        [UP, DOWN, UP],
        [UP, UP, UP],
        [UP, DOWN[1:], UP[1:]],
        [DOWN, DOWN],
        [[-4, -3, -2], [-2, -3, -4], [-4, -3, -2]],
        [[0, 60, 120, 180], [180, 120, 60, 0], [0, 60, 120, 180]],
        [[0, 90, 180], [180, 90, 0], [0, 90, 180]],
        [UP],
    ],
)
def test_each_turn_and_each_return_to_the_start_begins_a_sweep(tmp_path, passes) -> None:
    scan = of_angles(tmp_path, [angle for one in passes for angle in one])
    assert sweep_angles(scan) == passes
    assert scan.passes == len(passes)


def test_a_servo_that_trembles_makes_no_new_sweeps(tmp_path) -> None:
    trembling = [angle + (-7 if index % 4 == 2 else 0) for index, angle in enumerate(UP)]
    assert of_angles(tmp_path, trembling).passes == 1


def test_a_long_pass_is_dealt_out_to_sweeps_that_each_cover_all_of_it(tmp_path) -> None:
    scan = of_angles(tmp_path, list(range(181)))
    assert scan.passes == 1
    assert sweep_angles(scan) == [list(range(start, 181, 3)) for start in range(3)]


def test_readings_repeated_at_each_angle_make_a_sweep_each(tmp_path) -> None:
    scan = of_angles(tmp_path, [angle for angle in UP for _ in range(5)] + [angle for angle in DOWN for _ in range(5)])
    assert scan.passes == 2
    assert sweep_angles(scan) == [UP] * 5 + [DOWN] * 5


def test_another_place_begins_a_sweep_and_is_its_pose(tmp_path) -> None:
    columns = Columns("angle", "range", x="x", y="y", heading="heading")
    rows = [(x, heading, angle) for x, heading in ((0, 0), (150, 90)) for angle in UP]
    text = "x,y,heading,angle,range\n" + "".join(f"{x},20,{heading},{angle},100\n" for x, heading, angle in rows)
    scan = imported(tmp_path, text, columns=columns)
    assert (scan.places, sweep_angles(scan)) == (2, [UP, UP])
    poses = [(pose.x_m, pose.y_m, pose.heading_rad) for pose in (sweep.pose for sweep in scan.sweeps)]
    assert poses == [(0, pytest.approx(0.2), 0), (1.5, pytest.approx(0.2), pytest.approx(math.pi / 2))]
    assert scan.sweeps[0].pose.sigma_position_m == 0.01, "a pose that someone measured is not exact"


def test_a_column_that_counts_sweeps_says_where_each_begins(tmp_path) -> None:
    text = "n,angle,range\n" + "".join(f"{index // 4},{index % 3},100\n" for index in range(12))
    scan = imported(tmp_path, text, columns=Columns("angle", "range", sweep="n"))
    assert [len(sweep.readings) for sweep in scan.sweeps] == [4, 4, 4]


def test_a_file_without_times_claims_none(tmp_path) -> None:
    (sweep,) = of_angles(tmp_path, UP).sweeps
    assert not sweep.HasField("start")
    assert {reading.time_offset_s for reading in sweep.readings} == {0.0}


def test_times_of_the_scanners_own_clock_are_offsets_and_no_start(tmp_path) -> None:
    text = "angle,range,millis\n" + "".join(f"{angle},100,{5000 + 60 * n}\n" for n, angle in enumerate(UP))
    scan = imported(tmp_path, text, columns=Columns("angle", "range", time="millis"), time_units="ms")
    (sweep,) = scan.sweeps
    assert not sweep.HasField("start")
    assert [reading.time_offset_s for reading in sweep.readings[:3]] == pytest.approx([0, 0.06, 0.12])


@pytest.mark.parametrize("stamp", ["2024-05-01T12:00:00Z", "2024-05-01T14:00:00+02:00", "1714564800"])
def test_times_of_day_give_a_start_that_is_known_to_a_second(tmp_path, stamp) -> None:
    text = f"angle;range;time\n1;20;{stamp}\n2;21;{stamp}\n"
    scan = imported(
        tmp_path, text, columns=Columns("angle", "range", time="time"), time_units="s" if "T" not in stamp else None
    )
    assert scan.sweeps[0].start.seconds == 1_714_564_800  # date -u -d 2024-05-01T12:00:00Z +%s
    assert scan.sweeps[0].clock_error_s == 1.0


def test_a_scanner_that_started_again_begins_a_sweep(tmp_path) -> None:
    text = "angle,range,t_s\n" + "".join(f"{angle},100,{angle % 60}\n" for angle in range(0, 120, 5))
    scan = imported(tmp_path, text, columns=Columns("angle", "range", time="t_s"))
    assert sweep_angles(scan) == [list(range(0, 60, 5)), list(range(60, 120, 5))]


def test_a_program_that_reckons_with_another_speed_of_sound_is_corrected(tmp_path) -> None:
    scan = imported(tmp_path, "angle,range\n1,170\n2,170\n", speed_of_sound_m_s=340.0, air_temperature_c=0.0)
    assert scan.sweeps[0].readings[0].time_of_flight_s == pytest.approx(0.01)  # 2 x 1.7 m / 340 m/s
    assert scan.sweeps[0].air_temperature_c == 0.0


def test_the_same_file_is_the_same_survey_and_another_file_another(tmp_path) -> None:
    once, again = of_angles(tmp_path, UP), of_angles(tmp_path, UP)
    assert once.sweeps == again.sweeps
    assert of_angles(tmp_path, DOWN).sweeps[0].log_id != once.sweeps[0].log_id
    assert of_angles(tmp_path, UP, unit="other").sweeps[0].log_id != once.sweeps[0].log_id
