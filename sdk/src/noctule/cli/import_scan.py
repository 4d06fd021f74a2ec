"""The command that makes a survey of what another scanner has written."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from noctule.program_options import NAME, check_folders, suffixed
from noctule.scans.options import AIR_TEMPERATURE_C, STATED_SIGMA_DEG, STATED_SIGMA_M, Columns, ScanOptions


class Lengths(StrEnum):
    """Units of a range."""

    MM, CM, M, IN, FT = "mm", "cm", "m", "in", "ft"


class Angles(StrEnum):
    """Units of an angle."""

    DEG, RAD = "deg", "rad"


class Times(StrEnum):
    """Units of a time."""

    S, MS, US = "s", "ms", "us"


def import_(
    scan: Annotated[Path, typer.Argument(metavar="SCAN", help="CSV, a serial log, or JSON lines.")],
    angle: Annotated[str, typer.Option(metavar="COLUMN", help="Column of the angles, by name or by number from 1.")],
    distance: Annotated[str, typer.Option("--range", metavar="COLUMN", help="Column of the ranges.")],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.jsonl|OUT.mcap",
            callback=suffixed(".jsonl", ".mcap"),
            help="The survey; SCAN with .jsonl if left out.",
        ),
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
        str | None,
        typer.Option(
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
    sigma_position_m: Annotated[float, typer.Option(help="How well a stated place is known.")] = STATED_SIGMA_M,
    sigma_heading_deg: Annotated[
        float, typer.Option(help="How well a stated heading is known.", min=0, max=180)
    ] = STATED_SIGMA_DEG,
    time: Annotated[str | None, typer.Option(metavar="COLUMN", help="Column of the times, if there is one.")] = None,
    time_units: Annotated[Times | None, typer.Option(help="Of the times, if they are numbers.")] = None,
    sweep: Annotated[
        str | None,
        typer.Option(metavar="COLUMN", help="Column that numbers the sweeps; by its turns if left out."),
    ] = None,
    air_temperature_c: Annotated[float, typer.Option(help="Of the air, during the scan.")] = AIR_TEMPERATURE_C,
    speed_of_sound_m_s: Annotated[
        float | None,
        typer.Option(help="With which the scanner's program counts; that of the air if left out.", min=100, max=1000),
    ] = None,
    skip_bad_lines: Annotated[
        bool, typer.Option("--skip-bad-lines", help="Leave out lines that are no readings, and count them.")
    ] = False,
    site: Annotated[str, typer.Option(callback=NAME, metavar="NAME", help="The survey's site.")] = "scan",
    unit: Annotated[str, typer.Option(callback=NAME, metavar="NAME", help="The scanner's name.")] = "scanner",
    force: Annotated[bool, typer.Option("--force", help="Write over OUT if it is there.")] = False,
) -> None:
    """Make a survey of the angles and ranges that another scanner has written."""
    from noctule.cli.scan_survey import air_c, counted, pose_of, sigma_m, target_of, write
    from noctule.scans.importing import import_scan

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
        pose=None if pose is None else pose_of(pose),
        sigma_position_m=sigma_m(sigma_position_m),
        sigma_heading_deg=sigma_heading_deg,
        air_temperature_c=air_c(air_temperature_c),
        speed_of_sound_m_s=speed_of_sound_m_s,
        skip_bad_lines=skip_bad_lines,
        site=site,
        unit=unit,
    )
    target = target_of(scan, out, force)
    check_folders(target)
    imported = import_scan(scan, options)
    write(imported, target)
    for note in imported.notes:
        typer.echo(f"noctule: {scan}: {note}", err=True)
    typer.echo(counted(imported, target))
