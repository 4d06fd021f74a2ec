"""noctule-mapper survey: the poses that the mapper has fitted, shown and written into the site file on request."""

from collections.abc import Iterator
from math import radians
from pathlib import Path
from typing import Any

import pytest
from mapper.command import noctule_mapper
from system.processes import free_ports

from noctule import bus, keys, site
from noctule.messages_pb2 import (
    POSE_STATE_FITTED,
    POSE_STATE_OPEN,
    POSE_STATE_WRONG,
    Contour,
    Pose,
    PoseState,
    UnitPose,
)
from noctule_mapper.calibration.site_edit import write_edits
from noctule_mapper.calibration.unit_survey import UnitSurveyError, edits, unit_verdicts

FILE = """site = "attic" # the one
[[unit]] # by the door
name = "u1"
serial = 1
address = "a"
pose = { x_m = 1.0, y_m = 2.0, heading_deg = 90 } # by tape

[[unit]]
name = "u2"
serial = 2
address = "b"
pose = "unknown" # behind the shelf
[[unit]]
name = "u3"
serial = 3
address = "c"
pose = { x_m = 3.0, y_m = 0.0, heading_deg = 0 }
pose_sigma = { position_m = 0.02, heading_deg = 2 }
"""
# 2 mm along each axis and 0.1 degrees: better than what is written, 5 mm and 0.5 degrees.
ERRORS = [4e-6, 0, 0, 0, 4e-6, 0, 0, 0, radians(0.1) ** 2]
WRITTEN = 0.005, radians(0.5)
BY_TAPE = Pose(x_m=1.0, y_m=2.0, heading_rad=radians(90), sigma_position_m=0.03, sigma_heading_rad=radians(3))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "site.toml"
    path.write_text(FILE)
    return path


def pose(unit: str, x_m: float, stated: Pose, state: PoseState, **more: Any) -> UnitPose:
    where = {"x_m": x_m, "y_m": 2.0, "heading_rad": radians(91), "covariance": ERRORS}
    return UnitPose(unit=unit, stated=stated, state=state, **where, **more)


def contour(state: PoseState = POSE_STATE_FITTED) -> Contour:
    """u1 fixes the frame and is fitted, u2 had no pose, u3 was stated 2 m away; both of these are in ``state``."""
    third = Pose(x_m=3.0, sigma_position_m=0.02, sigma_heading_rad=radians(2))
    return Contour(
        site="attic",
        poses=[
            pose("u1", 1.012, BY_TAPE, POSE_STATE_FITTED, fixes_frame=True),
            pose("u2", 4.5, Pose(sigma_position_m=100), state),
            pose("u3", 3.3, third, state),
        ],
    )


def written(file: Path, of: Contour, *units: str) -> dict[str, site.PoseSource]:
    """The poses by unit after the contour's have been written."""
    write_edits(file, edits(unit_verdicts(of, site.load(file), file, units), file))
    return {unit.name: unit.pose for unit in site.load(file).units}


def at(x_m: float) -> site.FixedPose:
    return site.FixedPose(site.Pose2(x_m, 2.0, radians(91), *WRITTEN))


def test_fitted_and_found_poses_are_written_with_errors_that_leave_room_for_the_next_fit(file: Path) -> None:
    assert written(file, contour()) == {"u1": at(1.012), "u2": at(4.5), "u3": at(3.3)}
    kept = [line for line in FILE.splitlines() if not line.startswith("pose")]
    assert [line for line in file.read_text().splitlines() if not line.startswith("pose")] == kept
    assert all(comment in file.read_text() for comment in ("# by tape", "# behind the shelf"))


def test_what_has_been_written_is_not_written_again(file: Path) -> None:
    written(file, contour())
    assert not edits(unit_verdicts(contour(), site.load(file), file), file)


def test_where_the_room_can_not_tell_nothing_is_written(file: Path) -> None:
    poses = written(file, contour(POSE_STATE_OPEN))
    assert poses["u2"] == site.UnknownPose()
    assert poses["u3"] == site.FixedPose(site.Pose2(3.0, 0.0, 0.0, 0.02, radians(2)))


def test_a_wrong_pose_is_written_only_by_name(file: Path) -> None:
    verdicts = unit_verdicts(contour(POSE_STATE_WRONG), site.load(file), file)
    (third,) = [verdict for verdict in verdicts if verdict.unit == "u3"]
    assert third.fields is None
    assert "WRONG POSE: " in third.said
    assert "give --unit u3" in third.said
    assert written(file, contour(POSE_STATE_WRONG), "u3")["u3"] == at(3.3)


def test_a_file_that_has_the_frames_unit_elsewhere_than_its_sweeps_is_refused(file: Path) -> None:
    file.write_text(FILE.replace("x_m = 1.0", "x_m = 1.5"))
    with pytest.raises(UnitSurveyError, match=r"'u1', which fixes the frame, at \(1.5, 2\) m.*restart the gateway"):
        unit_verdicts(contour(), site.load(file), file)


def test_a_unit_that_moves_or_is_in_no_file_is_left_out_and_named(file: Path) -> None:
    moving = FILE.replace('pose = "unknown"', 'pose = "key"')
    file.write_text(moving[: moving.rindex("[[unit]]")])
    said = {verdict.unit: verdict.said for verdict in unit_verdicts(contour(), site.load(file), file)}
    assert "the site file says that it moves" in said["u2"]
    assert "it is not in the site file" in said["u3"]


# ---- The command


@pytest.fixture
def router() -> Iterator[str]:
    """A router on which a mapper has published the contour."""
    (port,) = free_ports(1)
    endpoint = f"tcp/127.0.0.1:{port}"
    with bus.open_session(listen=[endpoint]) as session:
        published = bus.StatePublisher(session, keys.contour("attic"), Contour)
        published.put(contour())
        yield endpoint
        published.close()


def test_a_running_mapper_is_asked_and_the_file_written_on_request_only(file: Path, router: str) -> None:
    shown = noctule_mapper("survey", "--site", file, "--connect", router)
    assert shown.exit_code == 0, shown.complaint
    assert "u2: found at (4.50, 2.00) m, 91.0 deg, ±0.2 cm, ±0.1 deg" in shown.output
    assert "pose = { x_m = 1.012, y_m = 2, heading_deg = 91, sigma_position_m = 0.005, " in shown.output
    assert "--write" in shown.output
    assert file.read_text() == FILE
    assert "Written to" in noctule_mapper("survey", "--site", file, "--connect", router, "--write").output
    assert site.load(file).unit("u2").pose == at(4.5)
    assert "Nothing to change" in noctule_mapper("survey", "--site", file, "--connect", router, "--write").output


@pytest.mark.parametrize(
    ("name", "options", "complaint"),
    [
        ("attic", ("--unit", "u9"), "has no unit 'u9'"),
        ("cellar", (), "no mapper has a contour of site 'cellar'"),
    ],
)
def test_what_can_not_be_done_is_told_in_one_line(
    file: Path, router: str, name: str, options: tuple[str, ...], complaint: str
) -> None:
    text = FILE.replace("attic", name)
    file.write_text(text)
    result = noctule_mapper("survey", "--site", file, "--connect", router, "--write", *options)
    assert result.exit_code == 1
    assert complaint in result.complaint
    assert result.complaint.count("\n") == 1
    assert file.read_text() == text
