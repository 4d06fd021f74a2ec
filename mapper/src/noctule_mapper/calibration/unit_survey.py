"""Where the units of a site are, by a contour's poses: what of it a site file does not say yet."""

from collections.abc import Collection
from dataclasses import dataclass
from math import ceil, degrees, hypot, pi, remainder
from pathlib import Path

from noctule import poses, toml_file
from noctule.errors import NoctuleError, SiteFileError
from noctule.messages_pb2 import POSE_STATE_FITTED, POSE_STATE_WRONG, Contour, Pose, UnitPose
from noctule.site import FixedPose, PoseSource, Site, UnknownPose
from noctule_mapper.calibration.site_edit import Edit

# A fit may be too sure of itself: it shares its errors with the walls that it stands on.
LEAST_POSITION_M, LEAST_HEADING_DEG = 0.005, 0.5
_SAME_M, _SAME_DEG = 0.001, 0.05  # rounding, in the file and on the bus


class UnitSurveyError(NoctuleError):
    """Poses that can't be written into a site file; the message says why and what to do."""


@dataclass(frozen=True)
class Verdict:
    """What the contour says of one unit, for people, and what is to be written into the file; None for nothing."""

    unit: str
    said: str
    fields: dict[str, float] | None


def unit_verdicts(contour: Contour, site: Site, file: Path, chosen: Collection[str] = ()) -> list[Verdict]:
    """What is to be written of each unit in the contour, or of the ``chosen`` ones: a fitted pose that the file does
    not have yet. A pose that the fit calls wrong is written only if its unit is ``chosen``: a person must look first.

    Raises UnitSurveyError where contour and file don't go together, SiteFileError where the file has no chosen unit.
    """
    if contour.site != site.name:
        raise UnitSurveyError(
            f"the poses are of site {contour.site!r} and {file} is of {site.name!r}: give its own file"
        )
    for name in chosen:
        site.unit(name)
    if not contour.poses:
        raise UnitSurveyError(
            "the contour has no unit's pose: that takes fixed units that sweep finely (steps of 4.5 degrees, say)"
        )
    found = {pose.unit: pose for pose in contour.poses}
    if missing := [name for name in chosen if name not in found]:
        raise UnitSurveyError(f"the contour says nothing of {', '.join(missing)}: it has poses of {', '.join(found)}")
    in_file = {unit.name: unit.pose for unit in site.units}
    _check_frame(contour, in_file, file)
    return [
        _verdict(pose, in_file.get(pose.unit), chosen) for pose in contour.poses if not chosen or pose.unit in chosen
    ]


def edits(verdicts: Collection[Verdict], file: Path) -> list[Edit]:
    """The edits that write the verdicts into the site ``file``."""
    stated_apart = _units_with_pose_sigma(file)
    done = []
    for verdict in verdicts:
        if verdict.fields is None:
            continue
        fields = dict(verdict.fields)
        if verdict.unit in stated_apart:
            position_m, heading_deg = fields.pop("sigma_position_m"), fields.pop("sigma_heading_deg")
            done.append(Edit(verdict.unit, "pose_sigma", {"position_m": position_m, "heading_deg": heading_deg}))
        done.append(Edit(verdict.unit, "pose", fields))
    return done


def _verdict(pose: UnitPose, source: PoseSource | None, chosen: Collection[str]) -> Verdict:
    said = poses.words(pose)
    if not isinstance(source, FixedPose | UnknownPose):
        why = "it is not in the site file" if source is None else "the site file says that it moves"
        return Verdict(pose.unit, f"{said}; {why}, left out", None)
    if pose.state == POSE_STATE_WRONG and pose.unit not in chosen:
        return Verdict(pose.unit, f"{said}; look at it, and give --unit {pose.unit} if that is right", None)
    if pose.state not in (POSE_STATE_FITTED, POSE_STATE_WRONG):
        return Verdict(pose.unit, said, None)
    fields = _fields(pose)
    if fields is None:
        return Verdict(pose.unit, f"{said}; its error is not known, left out", None)
    if isinstance(source, FixedPose) and _has(source, fields):
        return Verdict(pose.unit, f"{said}; the file has it", None)
    return Verdict(pose.unit, said, fields)


def _fields(pose: UnitPose) -> dict[str, float] | None:
    known = poses.sigmas(pose)
    if known is None:
        return None
    return {
        "x_m": round(pose.x_m, 4),
        "y_m": round(pose.y_m, 4),
        "heading_deg": round(degrees(remainder(pose.heading_rad, 2 * pi)), 2),
        "sigma_position_m": max(LEAST_POSITION_M, ceil(known[0] * 1e3) / 1e3),
        "sigma_heading_deg": max(LEAST_HEADING_DEG, ceil(known[1] * 10) / 10),
    }


def _has(source: FixedPose, fields: dict[str, float]) -> bool:
    there = source.pose
    turned_deg = remainder(degrees(there.heading_rad) - fields["heading_deg"], 360)
    return (
        hypot(there.x_m - fields["x_m"], there.y_m - fields["y_m"]) < _SAME_M
        and abs(turned_deg) < _SAME_DEG
        and abs(there.sigma_position_m - fields["sigma_position_m"]) < _SAME_M
        and abs(degrees(there.sigma_heading_rad) - fields["sigma_heading_deg"]) < _SAME_DEG
    )


def _check_frame(contour: Contour, in_file: dict[str, PoseSource], file: Path) -> None:
    """The units that fix the frame must stand in the file where the sweeps say, or where this very fit has them."""
    for pose in contour.poses:
        source = in_file.get(pose.unit)
        if not pose.fixes_frame or not isinstance(source, FixedPose):
            continue
        fields = _fields(pose)
        if not _is_at(source, pose.stated) and not (fields and _has(source, fields)):
            here, there = source.pose, pose.stated
            raise UnitSurveyError(
                f"{file} has unit {pose.unit!r}, which fixes the frame, at ({here.x_m:g}, {here.y_m:g}) m, and its "
                f"sweeps say ({there.x_m:g}, {there.y_m:g}) m: restart the gateway with this file and survey again"
            )


def _is_at(source: FixedPose, stated: Pose) -> bool:
    turned_rad = remainder(source.pose.heading_rad - stated.heading_rad, 2 * pi)
    away_m = hypot(source.pose.x_m - stated.x_m, source.pose.y_m - stated.y_m)
    return away_m < _SAME_M and degrees(abs(turned_rad)) < _SAME_DEG


def _units_with_pose_sigma(file: Path) -> set[str]:
    """The units whose errors the file states in pose_sigma, beside the pose."""
    entries = toml_file.read(file, SiteFileError).entries
    return {unit["name"] for unit in entries["unit"] if "pose_sigma" in unit}
