"""Which plan a unit gets, by how the site file says that it stands."""

from dataclasses import replace
from math import degrees, radians
from pathlib import Path

import pytest

from noctule.site import load
from noctule_gateway.unit.plans import FIXED_PLAN, OWN_PLAN, wanted_plan
from noctule_gateway.wire.frames import Configure
from noctule_gateway.wire.units import BEARING_RAD

FIXED = "pose = { x_m = 1.0, y_m = 2.0, heading_deg = 90 }"
CARRIED = (
    "path = { corners_m = [[0.0, 0.0], [1.0, 0.0]], spacing_m = 0.2 }",
    'pose = "key"',
)


def wanted(folder: Path, *lines: str) -> Configure | None:
    """The plan of a unit whose table in the site file goes on with ``lines``."""
    path = folder / "site.toml"
    unit = ('site = "attic"', "[[unit]]", 'name = "u1"', "serial = 1", 'address = "/dev/ttyUSB0"', *lines)
    path.write_text("\n".join(unit))
    return wanted_plan(load(path).unit("u1"))


def test_a_fixed_unit_sweeps_finely_unless_the_site_file_says_otherwise(tmp_path: Path) -> None:
    plan = wanted(tmp_path, FIXED, "sweep = { start = true, pause_s = 5 }")
    assert plan == wanted(tmp_path, FIXED) == FIXED_PLAN
    # As far as a unit's own plan, -135 to 135 degrees, by 4.5 (a lobe of 20 degrees is heard at four of them).
    assert plan is not None and plan.count == 61
    assert degrees(plan.first_bearing * BEARING_RAD) == -135
    assert degrees(plan.bearing_step * BEARING_RAD) == pytest.approx(4.5, abs=360 / 65536)


@pytest.mark.parametrize("pose", CARRIED)
def test_a_unit_that_is_carried_keeps_its_own_plan(pose: str, tmp_path: Path) -> None:
    assert wanted(tmp_path, pose, "sweep = { start = true }") is None
    assert wanted(tmp_path, pose, "sweep = { pings = 3 }") == replace(OWN_PLAN, pings=3)


def test_how_a_fixed_unit_pings_and_turns_may_be_said_without_its_bearings(tmp_path: Path) -> None:
    plan = wanted(tmp_path, FIXED, "sweep = { pings = 3, ramp_s = 0.2 }")
    assert plan == replace(FIXED_PLAN, pings=3, ramp_ms=200)


@pytest.mark.parametrize("pose", [FIXED, CARRIED[0]])
@pytest.mark.parametrize(
    ("sweep", "ramp_ms", "is_warned"),
    [
        ("ramp_s = 0", 50, True),  # the top speed is 600 half steps/s where none is given
        ("ramp_s = 0.049, top_speed_half_steps_s = 501", 50, True),
        ("ramp_s = 0.05, top_speed_half_steps_s = 501", 50, False),
        ("ramp_s = 0, top_speed_half_steps_s = 500", 0, False),
    ],
)
def test_a_ramp_that_was_valid_before_firmware_0_4_is_lengthened_with_a_warning(
    pose: str, sweep: str, ramp_ms: int, is_warned: bool, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    plan = wanted(tmp_path, pose, f"sweep = {{ {sweep} }}")
    assert plan is not None and plan.ramp_ms == ramp_ms
    assert ("u1: a ramp of" in caplog.text and "gets one of 0.05 s" in caplog.text) == is_warned


def test_a_top_speed_that_was_valid_before_firmware_0_6_is_lowered_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    plan = wanted(tmp_path, FIXED, "sweep = { top_speed_half_steps_s = 801, ramp_s = 0 }")
    assert plan == replace(FIXED_PLAN, top_speed=800, ramp_ms=50)  # firmware/README.md, CONFIGURE
    assert "u1: 801 half steps/s are more than a unit takes, so it gets 800" in caplog.text
    assert "u1: a ramp of 0 s is too short for 800 half steps/s" in caplog.text


@pytest.mark.parametrize("given", ["first_bearing_deg = -140", "bearing_step_deg = 10", "count = 7"])
def test_bearings_that_a_fixed_units_file_gives_in_part_are_completed_by_the_units_own(
    given: str, tmp_path: Path
) -> None:
    values = {"first_bearing": radians(-140), "bearing_step": radians(10), "count": 7 * BEARING_RAD}
    name = next(name for name in values if name in given)
    plan = wanted(tmp_path, FIXED, f"sweep = {{ {given} }}")
    assert plan == replace(OWN_PLAN, **{name: round(values[name] / BEARING_RAD)})
