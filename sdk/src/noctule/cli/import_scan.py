"""The command that makes a survey of what another scanner has written."""

import math
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from noctule import bounds, keys, survey
from noctule.errors import KeyFormatError, SurveyError
from noctule.scans.importing import ImportedScan, import_scan
from noctule.scans.options import AIR_TEMPERATURE_C, STATED_SIGMA_DEG, STATED_SIGMA_M, Columns, ScanOptions
from noctule.site import Pose2


class Lengths(StrEnum):
    """Units of a range."""

    MM, CM, M, IN, FT = "mm", "cm", "m", "in", "ft"


class Angles(StrEnum):
    """Units of an angle."""

    DEG, RAD = "deg", "rad"


class Times(StrEnum):
    """Units of a time."""

    S, MS, US = "s", "ms", "us"


def _name(value: str) -> str:
    try:
        return keys.name(value, "the name")
    except KeyFormatError as error:
        raise typer.BadParameter(str(error)) from error


def _pose(value: str) -> Pose2:
    try:
        x_m, y_m, heading_deg = (float(part) for part in value.split(","))
    except ValueError as error:
        raise typer.BadParameter(f"{value!r}: give X,Y,HEADING in metres and degrees, as 1.2,0.4,90") from error
    for what, number, bound in (
        ("X", x_m, bounds.number("Pose", "x_m")),
        ("Y", y_m, bounds.number("Pose", "y_m")),
        ("HEADING", heading_deg, _TURN_DEG),
    ):
        if fault := bound.fault(number):
            raise typer.BadParameter(f"{what} {fault}")
    return Pose2(x_m, y_m, math.radians(heading_deg))


_TURN_DEG = bounds.Number(-360, 360, "degrees")
_SIGMA_M, _AIR_C = bounds.number("Pose", "sigma_position_m"), bounds.AIR_C


def import_(
    scan: Annotated[Path, typer.Argument(metavar="SCAN", help="CSV, a serial log, or JSON lines.")],
    angle: Annotated[str, typer.Option(metavar="COLUMN", help="Column of the angles, by name or by number from 1.")],
    distance: Annotated[str, typer.Option("--range", metavar="COLUMN", help="Column of the ranges.")],
    out: Annotated[
        Path | None, typer.Option(metavar="OUT.jsonl|OUT.mcap", help="The survey; SCAN with .jsonl if left out.")
    ] = None,
    units: Annotated[Lengths | None, typer.Option(help="Of the ranges, where the file does not say.")] = None,
    angle_units: Annotated[Angles | None, typer.Option(help="Of the angles; degrees if nothing says more.")] = None,
    clockwise: Annotated[bool, typer.Option("--clockwise", help="The angles grow clockwise, seen from above.")] = False,
    forward_deg: Annotated[
        float, typer.Option(help="The angle at which the scanner looks along its heading.", min=-360, max=360)
    ] = 0.0,
    no_echo: Annotated[
        str, typer.Option(metavar="VALUES", help="Ranges that mean nothing was heard: 0,797,nan,empty.")
    ] = "",
    no_echo_above: Annotated[
        float | None, typer.Option(metavar="RANGE", help="Ranges above it mean that too, in the file's units.")
    ] = None,
    pose: Annotated[
        Pose2 | None,
        typer.Option(
            parser=_pose,
            metavar="X,Y,HEADING",
            help="Where it stood, in metres and degrees; if left out, its own frame.",
        ),
    ] = None,
    x: Annotated[str | None, typer.Option("--x", metavar="COLUMN", help="Where it stood, if it was moved.")] = None,
    y: Annotated[str | None, typer.Option("--y", metavar="COLUMN", help="The same.")] = None,
    heading: Annotated[
        str | None, typer.Option(metavar="COLUMN", help="Its heading there, anticlockwise from the x axis.")
    ] = None,
    place_units: Annotated[Lengths | None, typer.Option(help="Of x and y; those of the ranges if left out.")] = None,
    sigma_position_m: Annotated[
        float, typer.Option(help="How well a stated place is known.", min=_SIGMA_M.least, max=_SIGMA_M.most)
    ] = STATED_SIGMA_M,
    sigma_heading_deg: Annotated[
        float, typer.Option(help="How well a stated heading is known.", min=0, max=180)
    ] = STATED_SIGMA_DEG,
    time: Annotated[str | None, typer.Option(metavar="COLUMN", help="Column of the times, if there is one.")] = None,
    time_units: Annotated[Times | None, typer.Option(help="Of the times, if they are numbers.")] = None,
    sweep: Annotated[
        str | None,
        typer.Option(metavar="COLUMN", help="Column that numbers the sweeps; by its turns if left out."),
    ] = None,
    air_temperature_c: Annotated[
        float, typer.Option(help="Of the air, during the scan.", min=_AIR_C.least, max=_AIR_C.most)
    ] = AIR_TEMPERATURE_C,
    speed_of_sound_m_s: Annotated[
        float | None,
        typer.Option(help="By which the scanner's program reckons; that of the air if left out.", min=100, max=1000),
    ] = None,
    skip_bad_lines: Annotated[
        bool, typer.Option("--skip-bad-lines", help="Leave out lines that are no readings, and count them.")
    ] = False,
    site: Annotated[str, typer.Option(parser=_name, metavar="NAME", help="The survey's site.")] = "scan",
    unit: Annotated[str, typer.Option(parser=_name, metavar="NAME", help="The scanner's name.")] = "scanner",
    force: Annotated[bool, typer.Option("--force", help="Write over OUT if it is there.")] = False,
) -> None:
    """Make a survey of the angles and ranges that another scanner has written."""
    if (x is None) != (y is None) or (heading is not None and x is None):
        raise typer.BadParameter("a place takes --x and --y, and --heading stands with them", param_hint="--x, --y")
    options = ScanOptions(
        columns=Columns(angle, distance, time, sweep, x, y, heading),
        units=units,
        angle_units=angle_units,
        time_units=time_units,
        place_units=place_units,
        no_echo=tuple(part.strip() for part in no_echo.split(",") if part.strip()),
        no_echo_above=no_echo_above,
        clockwise=clockwise,
        forward_deg=forward_deg,
        pose=pose,
        sigma_position_m=sigma_position_m,
        sigma_heading_deg=sigma_heading_deg,
        air_temperature_c=air_temperature_c,
        speed_of_sound_m_s=speed_of_sound_m_s,
        skip_bad_lines=skip_bad_lines,
        site=site,
        unit=unit,
    )
    target = _target(scan, out, force)
    imported = import_scan(scan, options)
    _write(imported, target)
    for note in imported.notes:
        typer.echo(f"noctule: {scan}: {note}", err=True)
    typer.echo(_summary(imported, target))


def _target(scan: Path, out: Path | None, force: bool) -> Path:
    target = out or scan.with_suffix(".jsonl")
    if target.exists() and (target.samefile(scan) if scan.exists() else False):
        raise SurveyError(f"{target} is the scan itself: name the survey with --out")
    if target.exists() and not force:
        raise SurveyError(f"{target} is there already: name another file with --out, or write over it with --force")
    return target


def _write(imported: ImportedScan, target: Path) -> None:
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


def _summary(imported: ImportedScan, target: Path) -> str:
    counts = [
        _counted(imported.readings, "reading"),
        _counted(imported.echoes, "echo", "echoes"),
        _counted(imported.passes, "pass", "passes"),
        _counted(imported.places, "place"),
    ]
    return f"{target}: {', '.join(counts)}: {_counted(len(imported.sweeps), 'sweep')}"


def _counted(count: int, one: str, many: str | None = None) -> str:
    return f"{count} {one if count == 1 else many or one + 's'}"
