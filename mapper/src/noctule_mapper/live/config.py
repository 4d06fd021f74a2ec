"""The parameters of the live mapper, and the TOML files that people write them in."""

import difflib
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from noctule import toml_file
from noctule.errors import NoctuleError
from noctule.wanted import wanted
from noctule_mapper.choices import Method, Rule
from noctule_mapper.config import MapperConfig, SensorConfig, Window

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

_M = TypeVar("_M", bound=BaseModel)


class ConfigFileError(NoctuleError):
    """A file of parameters that can't be used; the message names the file, the field and what is wrong."""


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Pace(_Model):
    """How often the contour is fitted again."""

    shortest_interval_s: float = Field(default=1.0, ge=0)
    most_time_share: float = Field(default=0.5, gt=0, le=1)  # of one processor


class LiveConfig(_Model):
    """All of it, and the mapper's own."""

    window: Window = Window()
    pace: Pace = Pace()
    mapper: MapperConfig = MapperConfig()


def load_live(path: Path) -> LiveConfig:
    """Parameters from tables [window], [pace] and [mapper...], each with its default. Raises ConfigFileError."""
    return _validated(path, LiveConfig, toml_file.read(path, ConfigFileError).entries)


def in_force(
    config: Path | None, method: Method | None = None, rule: Rule | None = None, sensor: Path | None = None
) -> LiveConfig:
    """The parameters of the file ``config``, or the defaults, with what a command line sets in their place. Raises
    ConfigFileError.
    """
    given = {"method": method, "rule": rule, "sensor": load_sensor(sensor) if sensor else None}
    loaded = load_live(config) if config else LiveConfig()
    update = {name: value for name, value in given.items() if value is not None}
    return loaded.model_copy(update={"mapper": loaded.mapper.model_copy(update=update)})


def to_toml(config: LiveConfig) -> str:
    """Every parameter, as load_live() reads it."""
    return tomli_w.dumps(config.model_dump(mode="json", exclude_none=True))


def load_sensor(path: Path) -> SensorConfig:
    """A sensor's calibration from top-level fields, its beam in rad or deg. Raises ConfigFileError."""
    fields = toml_file.read(path, ConfigFileError).entries
    if "beam_width_deg" in fields:
        if "beam_width_rad" in fields:
            raise ConfigFileError(f"{path}: beam_width_deg and beam_width_rad are one quantity: keep one of them")
        width_deg = fields.pop("beam_width_deg")
        if not isinstance(width_deg, int | float):
            raise ConfigFileError(f"{path}: beam_width_deg should be a number, not {width_deg!r}")
        fields["beam_width_rad"] = math.radians(width_deg)
    return _validated(path, SensorConfig, fields)


def _validated(path: Path, model: type[_M], fields: dict[str, Any]) -> _M:
    try:
        return model.model_validate(fields)
    except ValidationError as error:
        wrong = "; ".join(f"{'.'.join(map(str, each['loc']))} is {_words(model, each)}" for each in error.errors())
        raise ConfigFileError(f"{path}: {wrong}") from error


def _words(model: type[BaseModel], error: "ErrorDetails") -> str:
    """What is wrong with a field; of one that there is none of, what was meant."""
    *tables, name = error["loc"]
    if error["type"] != "extra_forbidden":
        return f"{error['input']!r}: {wanted(error)}"
    for table in tables:
        model = model.model_fields[str(table)].annotation  # type: ignore[assignment]
    near = difflib.get_close_matches(str(name), model.model_fields, n=1)
    return "not known: " + (f"did you mean {near[0]}?" if near else f"known are {', '.join(model.model_fields)}")
