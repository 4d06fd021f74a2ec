"""A calibration in the files that hold one: the site file, and a sensor's own TOML."""

from pathlib import Path

from noctule import site
from noctule_mapper.calibration.calibrate import Calibration
from noctule_mapper.calibration.site_edit import Edit, write_edits
from noctule_mapper.calibration.wall_readings import CalibrationError
from noctule_mapper.export.atomic_write import write_whole


def sensor_fields(calibration: Calibration) -> dict[str, float]:
    """What a file says of the sensor, to a micrometre: its spread, and its mean error where that is known.

    Raises CalibrationError where the spread is none.
    """
    sigma_m = round(calibration.spread.sigma_range_m.value, 6)
    if not sigma_m:
        raise CalibrationError("all repeats are alike to a micrometre: that is no sensor's spread; survey a real wall")
    if calibration.mean_error_m is None:
        return {"range_sigma_m": sigma_m}
    return {"range_bias_m": round(calibration.mean_error_m.value, 6), "range_sigma_m": sigma_m}


def write_sensor(path: Path, fields: dict[str, float]) -> None:
    """A sensor's calibration for ``noctule-mapper fit --sensor``."""
    lines = "".join(f"{key} = {value}\n" for key, value in fields.items())
    write_whole({path: ("# Made by noctule-mapper calibrate.\n" + lines).encode()})


def write_into_site(path: Path, fields: dict[str, float], unit: str | None) -> site.Site:
    """Set ``fields`` in the site file's [sensor], or in the sensor of ``unit``; errors as of ``write_edits``."""
    return write_edits(path, [Edit(unit, "sensor", fields)])
