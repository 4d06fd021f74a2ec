"""Reads the fleet file. Every mistake in it is named at once: file, line, table, key, and what was probably meant."""

import difflib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from noctule import toml_file
from noctule.toml_lines import Place, line_of
from noctule.wanted import wanted
from noctule_deploy import fleet as tables
from noctule_deploy import fleet_rules
from noctule_deploy.errors import FleetFileError
from noctule_deploy.fleet import Fleet

_ALIKE = 0.7  # of difflib, as in the site file
_MODELS: dict[tuple[str, ...], type[BaseModel]] = {
    (): Fleet,
    ("firmware",): tables.Firmware,
    ("router",): tables.Router,
    ("gateway",): tables.Gateway,
    ("mapper",): tables.Mapper,
    ("operator",): tables.Watcher,
    ("viewer",): tables.Viewer,
    ("viewer", "web"): tables.Web,
    ("service",): tables.Service,
    ("service", "tracks"): tables.Tracked,
}


def load(path: Path) -> Fleet:
    """The fleet of a file. Raises FleetFileError with a line for each mistake."""
    file = toml_file.read(path, FleetFileError, if_absent="noctule-deploy init writes an example of one")
    try:
        fleet = Fleet.model_validate(file.entries, context=path.parent)
    except ValidationError as error:
        raise _error(path, file.lines, (_mistake(each, file.entries) for each in error.errors())) from error
    if found := list(fleet_rules.mistakes(fleet)):
        raise _error(path, file.lines, found)
    return fleet


def _error(path: Path, at: Mapping[Place, int], found: Iterable[tuple[Place, str]]) -> FleetFileError:
    said = []
    for place, problem in found:
        line = line_of(at, place) or line_of(at, (*place, 0))  # [[table]] is written for its elements only
        said.append((line or 0, f"{path}{f', line {line}' if line else ''}: {_table(place)}{problem}"))
    return FleetFileError("\n".join(text for _, text in sorted(said)))


def _mistake(error: Any, entries: dict[str, Any]) -> tuple[Place, str]:
    """One of pydantic's findings as an operator reads it: where, what is wrong, what to do."""
    place: Place = error["loc"]
    if place[-1] == "[key]":  # pydantic's word for a key of a free table
        place = place[:-1]
    above, key = _split(place)
    match error["type"]:
        case "extra_forbidden":
            return place, f"{key} is not known here{_known(key, above)}"
        case "missing":
            return place, f"{key} is missing: add it{_written_as(key, above, entries)}"
    return place, f"{key} is {error['input']!r}: {wanted(error)}"


def _split(place: Place) -> tuple[Place, str]:
    """The table that a key is in, and the key; an element of a list is written ``units[1]``."""
    *above, key = place
    if isinstance(key, int) and above:
        return tuple(above[:-1]), f"{above[-1]}[{key}]"
    return tuple(above), str(key)


def _table(place: Place) -> str:
    """How the table of ``place`` is called, as it is in the site file's errors; empty for the top of the file."""
    match _split(place)[0]:
        case ():
            return ""
        case (str(kind), int(index), *below):
            return f"[[{kind}]] {index + 1}: " + "".join(f"{step}." for step in below if isinstance(step, str))
        case above:
            return f"[{'.'.join(map(str, above))}]: "


def _known(key: str, above: Place) -> str:
    known = _fields(above)
    near = difflib.get_close_matches(key, known, 1, _ALIKE)
    return f": did you mean {near[0]}?" if near else f": correct or remove it (known: {', '.join(sorted(known))})"


def _written_as(key: str, above: Place, entries: Any) -> str:
    for step in above:
        entries = entries[step]
    near = difflib.get_close_matches(key, set(entries) - _fields(above), 1, _ALIKE)
    return f" (did you write it as {near[0]}?)" if near else ""


def _fields(above: Place) -> set[str]:
    return set(_MODELS[tuple(step for step in above if isinstance(step, str))].model_fields)
