"""A calibration in the files that hold one: the site file, comments and all kept, and a sensor's own TOML."""

import re
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Table

from noctule import site
from noctule.errors import SiteFileError
from noctule_mapper.calibration.calibrate import Calibration
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
    """Set ``fields`` in the site file's [sensor], or in the sensor of ``unit``, and leave all its other lines as they
    are, byte for byte; the site as it then is.

    Raises SiteFileError, the file as it was, where it is not a good site file, has no such unit or can't be edited.
    """
    before = site.load(path)
    if unit is not None:
        before.unit(unit)
    data = path.read_bytes()
    text = data.decode("utf-8-sig")
    mark = data.removesuffix(text.encode())  # some editors begin with a byte order mark
    new = edited(text, fields, unit)
    if tomllib.loads(new) != _expected(text, fields, unit):
        raise SiteFileError(f"{path}: its sensor is written in a way that can't be edited: enter {fields} by hand")
    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder) / path.name
        trial.write_bytes(mark + new.encode())
        after = site.load(trial)
    write_whole({path: mark + new.encode()})
    return after


def edited(text: str, fields: dict[str, float], unit: str | None) -> str:
    """The site file ``text`` with ``fields`` in its sensor, or in that of ``unit``."""
    document: Any = tomlkit.parse(text)
    holder = _holder(document, unit)
    if "sensor" not in holder:
        _add(holder, "sensor", tomlkit.table() if unit is None else tomlkit.inline_table())
    for key, value in fields.items():
        if key in holder["sensor"]:
            holder["sensor"][key] = value
        else:
            _add(holder["sensor"], key, value)
    new = tomlkit.dumps(document)
    only_crlf = "\r\n" in text and not re.search(r"(?<!\r)\n", text)
    return re.sub(r"(?<!\r)\n", "\r\n", new) if only_crlf else new


def _holder(document: Any, unit: str | None) -> Any:
    """The table that holds the sensor's."""
    return document if unit is None else next(each for each in document["unit"] if each["name"] == unit)


def _add(table: Any, key: str, value: Any) -> None:
    """Put a new key after the last one: the comments and empty lines that follow belong to the next table."""
    trailing = []
    if isinstance(table, Table):
        body = table.value.body
        while body and body[-1][0] is None:
            trailing.append(body.pop()[1])
    table.add(key, value)
    for item in reversed(trailing):
        table.add(item)


def _expected(text: str, fields: dict[str, float], unit: str | None) -> dict[str, Any]:
    entries = tomllib.loads(text)
    holder = _holder(entries, unit)
    holder["sensor"] = holder.get("sensor", {}) | fields
    return entries
