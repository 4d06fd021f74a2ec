"""The command ``calibrate``: a survey that faces a wall, the sensor's spread and mean error into files."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from noctule.program_options import check_folders

if TYPE_CHECKING:
    from noctule.messages_pb2 import Sweep
    from noctule_mapper.readings.sweep import SweepReadings


def calibrate(
    sweeps: Annotated[Path, typer.Argument(metavar="SURVEY", help="Sweeps as JSON lines, or MCAP by suffix.")],
    wall_distance: Annotated[
        float | None,
        typer.Option(
            min=0.0, help="Metres from the axis about which the sensor turns, at the survey's first place, to the wall."
        ),
    ] = None,
    facing_deg: Annotated[
        float | None, typer.Option(help="The wall's direction in the site's frame, where sweeps look elsewhere too.")
    ] = None,
    unit: Annotated[str | None, typer.Option(help="The unit to calibrate; its own sensor in the site file.")] = None,
    site: Annotated[Path | None, typer.Option(help="Site file to write the calibration into.")] = None,
    out: Annotated[Path | None, typer.Option(help="TOML file for fit --sensor.")] = None,
) -> None:
    """Calibrate a range sensor from repeated readings of a wall, and print what it is worth."""
    from noctule import survey
    from noctule_mapper.calibration.calibrate import calibrate as calibrate_sensor
    from noctule_mapper.calibration.sensor_files import sensor_fields, write_into_site, write_sensor
    from noctule_mapper.calibration.table import calibration_table
    from noctule_mapper.config import GridConfig, SensorConfig

    check_folders(out)
    messages = _of_one_unit(survey.read(sweeps), unit)
    facing_rad = None if facing_deg is None else math.radians(facing_deg)
    calibration = calibrate_sensor([_unbiased(message) for message in messages], wall_distance, facing_rad)
    print(calibration_table(calibration, GridConfig().epsilon_sigmas))
    if not any(message.HasField("air_temperature_c") for message in messages):
        assumed_c = SensorConfig().air_temperature_c
        print(f"No sweep tells the air's temperature, taken as {assumed_c:g} degrees: 10 K are 1.8 % of a range.")
    fields = sensor_fields(calibration)
    if out is not None:
        write_sensor(out, fields)
        print(f"Written to {out}.")
    if site is not None:
        after = write_into_site(site, fields, unit)
        print(f"Written to {site}, {f'unit {unit}' if unit else 'for all units without a calibration of their own'}.")
        own = [each.name for each in after.units if each.sensor.range_sigma_m != fields["range_sigma_m"]]
        if unit is None and own:
            print(f"These have their own: {', '.join(own)}; give --unit to change it.")


def _of_one_unit(sweeps: "Iterable[Sweep]", unit: str | None) -> "list[Sweep]":
    """The sweeps of the one unit, each once: read twice, they would make the figures look surer than they are."""
    from noctule_mapper.calibration.wall_readings import CalibrationError

    chosen = list(
        {sweep.SerializeToString(deterministic=True): sweep for sweep in sweeps if unit in (None, sweep.unit)}.values()
    )
    if not chosen:
        raise CalibrationError(f"the survey has no sweep{f' of unit {unit!r}' if unit else ''}: give one that has")
    names = sorted({f"{sweep.site}/{sweep.unit}" for sweep in chosen})
    if len(names) > 1:
        raise CalibrationError(f"the survey has sweeps of {', '.join(names)}: calibrate one, --unit NAME")
    return chosen


def _unbiased(sweep: "Sweep") -> "SweepReadings":
    """The sweep's readings with no mean error taken off, whatever has been known of it."""
    from noctule.messages_pb2 import Sweep
    from noctule_mapper.readings.sweep import from_message

    raw = Sweep()
    raw.CopyFrom(sweep)
    raw.sensor.range_bias_m = 0.0
    raw.sensor.ClearField("range_sigma_m")
    return from_message(raw)
