"""What ``import`` does beside the import: the bounds of what was typed, and the survey as a file."""

import math
from contextlib import suppress
from pathlib import Path

import typer

from noctule import bounds, survey
from noctule.errors import SurveyError
from noctule.scans.importing import ImportedScan
from noctule.site import Pose2

_TURN_DEG = bounds.Number(-360, 360, "degrees")


def pose_of(value: str) -> Pose2:
    """The pose that was typed. Raises BadParameter."""
    try:
        x_m, y_m, heading_deg = (float(part) for part in value.split(","))
    except ValueError as error:
        said = f"{value!r}: give X,Y,HEADING in metres and degrees, as 1.2,0.4,90"
        raise typer.BadParameter(said, param_hint="--pose") from error
    for what, number, bound in (
        ("X", x_m, bounds.number("Pose", "x_m")),
        ("Y", y_m, bounds.number("Pose", "y_m")),
        ("HEADING", heading_deg, _TURN_DEG),
    ):
        if fault := bound.fault(number):
            raise typer.BadParameter(f"{what} {fault}", param_hint="--pose")
    return Pose2(x_m, y_m, math.radians(heading_deg))


def sigma_m(value: float) -> float:
    """How well a place is known. Raises BadParameter."""
    return _within(bounds.number("Pose", "sigma_position_m"), value, "--sigma-position-m")


def air_c(value: float) -> float:
    """The air's temperature. Raises BadParameter."""
    return _within(bounds.AIR_C, value, "--air-temperature-c")


def _within(bound: bounds.Number, value: float, option: str) -> float:
    if fault := bound.fault(value):
        raise typer.BadParameter(fault, param_hint=option)
    return value


def target_of(scan: Path, out: Path | None, force: bool) -> Path:
    """Where the survey goes. Raises SurveyError where something else is there."""
    target = out or scan.with_suffix(".jsonl")
    if target.exists() and (target.samefile(scan) if scan.exists() else False):
        raise SurveyError(f"{target} is the scan itself: name the survey with --out")
    if target.exists() and not force:
        raise SurveyError(f"{target} is there already: name another file with --out, or write over it with --force")
    return target


def write(imported: ImportedScan, target: Path) -> None:
    """Put the whole survey in its place, or leave what is there."""
    part = target.with_name(f".{target.name}.part")
    try:
        if target.suffix == survey.MCAP_SUFFIX:
            from noctule import survey_mcap

            with part.open("wb") as stream:
                survey_mcap.write(imported.sweeps, stream)
        else:
            with part.open("w", encoding="utf-8") as stream:
                survey.write(imported.sweeps, stream)
        part.replace(target)
    except OSError as error:
        raise SurveyError(f"{target} can't be written: {error.strerror}") from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def counted(imported: ImportedScan, target: Path) -> str:
    """What was imported, in a line."""
    counts = [
        _counted(imported.readings, "reading"),
        _counted(imported.echoes, "echo", "echoes"),
        _counted(imported.passes, "pass", "passes"),
        _counted(imported.places, "place"),
    ]
    return f"{target}: {', '.join(counts)}: {_counted(len(imported.sweeps), 'sweep')}"


def _counted(count: int, one: str, many: str | None = None) -> str:
    return f"{count} {one if count == 1 else many or one + 's'}"
