"""Any survey written as a scanner writes it is that survey again; any bytes are a survey or one typed error."""

import csv
import io
import json
import math

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sdk.scanned import AIR_C, imported

from noctule import bounds
from noctule.air import speed_of_sound_m_s
from noctule.errors import ScanError
from noctule.messages_pb2 import READING_STATUS_ECHO, READING_STATUS_NO_ECHO, Pose, Reading, Sweep
from noctule.scans.options import Columns

STEPS_DEG = st.sampled_from([1.0, 1.8, 4.5, 22.5])

PLACES = st.tuples(st.floats(-9e3, 9e3), st.floats(-9e3, 9e3), st.floats(-6.2, 6.2))

FLIGHTS_S = st.none() | st.floats(1e-6, 4.4)


@st.composite
def surveys(draw) -> list[Sweep]:
    """Sweeps back and forth, or each from the start, over one plan of bearings, from places of their own."""
    count, step_deg, alternate = draw(st.integers(3, 64)), draw(STEPS_DEG), draw(st.booleans())
    first_deg = draw(st.floats(-150, 0))
    bearings_rad = [
        math.radians(min(first_deg + index * step_deg, 360)) for index in range(min(count, int(180 / step_deg)))
    ]
    sweeps = []
    for place in draw(st.lists(PLACES, min_size=1, max_size=3, unique_by=lambda one: one[0])):
        for number in range(draw(st.integers(1, 3))):
            order = bearings_rad[::-1] if alternate and number % 2 else bearings_rad
            flights_s = draw(st.lists(FLIGHTS_S, min_size=len(order), max_size=len(order)))
            sweeps.append(sweep_of(place, order, flights_s, len(sweeps) + 1))
    return sweeps


def sweep_of(place, bearings_rad, flights_s, number) -> Sweep:
    x_m, y_m, heading_rad = place
    sweep = Sweep(site="scan", unit="scanner", log_sequence=number, sequence=number, air_temperature_c=AIR_C)
    sweep.pose.CopyFrom(Pose(x_m=x_m, y_m=y_m, heading_rad=heading_rad))
    for bearing_rad, flight_s in zip(bearings_rad, flights_s, strict=True):
        status = READING_STATUS_NO_ECHO if flight_s is None else READING_STATUS_ECHO
        sweep.readings.append(Reading(bearing_rad=bearing_rad, time_of_flight_s=flight_s, status=status))
    return sweep


def as_csv(sweeps: list[Sweep]) -> str:
    """What a scanner would write of the same sweeps."""
    out = io.StringIO()
    rows = csv.writer(out)
    rows.writerow(["x_m", "y_m", "heading_rad", "angle_rad", "range_m"])
    for sweep in sweeps:
        for reading in sweep.readings:
            heard = reading.HasField("time_of_flight_s")
            range_m = repr(reading.time_of_flight_s * speed_of_sound_m_s(AIR_C) / 2) if heard else "nan"
            pose = sweep.pose
            rows.writerow([pose.x_m, pose.y_m, pose.heading_rad, repr(reading.bearing_rad), range_m])
    return out.getvalue()


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(surveys())
def test_a_survey_written_as_a_scanner_would_is_the_same_survey_again(tmp_path, sweeps) -> None:
    columns = Columns("angle_rad", "range_m", x="x_m", y="y_m", heading="heading_rad")
    scan = imported(
        tmp_path,
        as_csv(sweeps),
        columns=columns,
        units=None,
        no_echo=("nan",),
        sigma_position_m=0.0,
        sigma_heading_deg=0.0,
    )
    assert len(scan.sweeps) == len(sweeps)
    for ours, theirs in zip(scan.sweeps, sweeps, strict=True):
        bounds.check(ours)
        assert numbers(ours) == pytest.approx(numbers(theirs), rel=1e-12, abs=1e-12, nan_ok=True)
        assert (ours.site, ours.unit, ours.log_sequence) == (theirs.site, theirs.unit, theirs.log_sequence)
        assert [one.status for one in ours.readings] == [one.status for one in theirs.readings]


def numbers(sweep: Sweep) -> list[float]:
    flat = [sweep.pose.x_m, sweep.pose.y_m, sweep.pose.heading_rad, sweep.air_temperature_c]
    for reading in sweep.readings:
        flight_s = reading.time_of_flight_s if reading.HasField("time_of_flight_s") else math.nan
        flat += [reading.bearing_rad, flight_s, reading.time_offset_s]
    return flat


SEEDS = [
    b"angle,range\n1,20\n2,21\n3,22\n",
    b"10,20.11,21.12,22.13,23.",
    b'{"angle": 1, "range": 2}\n{"angle": 2, "range": 3}\n',
    b"Angle: 1, Range: 20 cm\nAngle: 2, Range: 21 cm\n",
    b"\xff\xfea\0n\0g\0l\0e\0,\0r\0a\0n\0g\0e\0\n\x001\0,\x002\0\n\0",
]

PIECES = st.sampled_from(
    [
        b",",
        b";",
        b"\n",
        b"\r",
        b"\0",
        b'"',
        b"{",
        b"}",
        b"[",
        b"-",
        b"e9",
        b"1e400",
        b"nan",
        b"9" * 5000,
        b"\xff",
        b":",
        b"\xb0",
    ]
)


@st.composite
def spoiled(draw) -> bytes:
    data = draw(st.sampled_from(SEEDS))
    for _ in range(draw(st.integers(0, 6))):
        at, length = draw(st.integers(0, len(data))), draw(st.integers(0, 5))
        data = data[:at] + draw(PIECES | st.binary(max_size=4)) + data[at + length :]
    return data


@settings(max_examples=400, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(spoiled() | st.binary(max_size=60), st.booleans(), st.booleans(), st.booleans())
def test_bytes_of_all_kinds_become_a_survey_within_bounds_or_one_typed_error(
    tmp_path, data, named, skip, timed
) -> None:
    columns = Columns("angle", "range", time="angle" if timed else None) if named else Columns("1", "2")
    try:
        scan = imported(tmp_path, data, columns=columns, skip_bad_lines=skip, time_units="s")
    except ScanError as error:
        assert str(error).startswith(str(tmp_path / "scan.csv"))
        return
    for sweep in scan.sweeps:
        bounds.check(sweep)
    assert sum(len(sweep.readings) for sweep in scan.sweeps) == scan.readings > 0
    json.dumps(scan.notes)
