"""Files of sweeps: JSON lines of the message Sweep, or MCAP where the file is named so."""

import json
import logging
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, NamedTuple

from google.protobuf import json_format
from google.protobuf.message import Message

from noctule import bounds
from noctule.errors import BoundsError, SurveyCutError, SurveyError
from noctule.messages_pb2 import Contour, ServiceStatus, Sweep, UnitStatus

MCAP_SUFFIX = ".mcap"

_log = logging.getLogger(__name__)


class Record(NamedTuple):
    """What a survey holds at one place: a sweep, or why there is none."""

    source: str  # the file
    number: int  # of its line, from 1; in MCAP of the sweep
    sweep: Sweep | SurveyError


def read(survey: Path | IO[str]) -> Iterator[Sweep]:
    """The sweeps of a file, or of an open text stream of JSON lines, in their order; empty lines are passed over.

    An MCAP file that was cut is read up to the cut, and the log warns of it.
    Raises SurveyError, naming the line and what is wrong with it, at the sweep that can't be read.
    """
    yield from _sound(read_records(survey))


def read_whole(survey: Path) -> Iterator[Sweep]:
    """As read(), but a cut is an error too. Raises SurveyError."""
    yield from _sound(_read_records(survey))


def read_units(survey: Path) -> Iterator[str]:
    """The unit of each sweep of a file that can be read, in their order. Raises SurveyError where the file can't be."""
    with suppress(SurveyCutError):
        for record in _read_records(survey):
            if isinstance(record.sweep, Sweep):
                yield record.sweep.unit


def read_records(survey: Path | IO[str]) -> Iterator[Record]:
    """As read(), but a sweep that can't be read does not end it. Raises SurveyError where the file itself can't be."""
    try:
        yield from _read_records(survey)
    except SurveyCutError as error:
        _log.warning("%s; what follows is lost", error)


def _sound(records: Iterator[Record]) -> Iterator[Sweep]:
    for record in records:
        if isinstance(record.sweep, SurveyError):
            raise record.sweep
        yield record.sweep


def _read_records(survey: Path | IO[str]) -> Iterator[Record]:
    if not isinstance(survey, Path):
        yield from _read_lines(survey, getattr(survey, "name", "survey"))
    elif survey.suffix == MCAP_SUFFIX:
        try:
            from noctule import survey_mcap
        except ModuleNotFoundError as error:
            raise SurveyError(f"{survey} can't be read: MCAP needs noctule[cli], install it") from error
        for number, sweep in enumerate(survey_mcap.read_each(survey), start=1):
            yield Record(str(survey), number, sweep)
    else:
        try:
            with survey.open(encoding="utf-8-sig") as lines:
                yield from _read_lines(lines, str(survey))
        except OSError as error:
            raise SurveyError(f"{survey} can't be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise SurveyError(
                f"{survey} is not text (byte {error.start}): give JSON lines of sweeps, or name an MCAP file .mcap"
            ) from error


def write(sweeps: Iterable[Sweep], stream: IO[str]) -> None:
    """Write sweeps as JSON lines. Raises SurveyError at one with a value beyond its bounds."""
    for sweep in sweeps:
        stream.write(to_json(sweep) + "\n")


def to_json(message: Message) -> str:
    """A message as one line of JSON: proto field names, fields at zero written out.

    Raises SurveyError where a value is beyond its bounds.
    """
    try:
        bounds.check(message)
    except BoundsError as error:
        raise SurveyError(f"a {message.DESCRIPTOR.name} can't be written: {error}") from error
    return json_format.MessageToJson(
        message, preserving_proto_field_name=True, always_print_fields_with_no_presence=True, indent=None
    )


def from_json(line: str, where: str) -> Sweep:
    """One line of a survey. Raises SurveyError, which begins with ``where``."""
    try:
        sweep = json_format.Parse(line, Sweep())
    except (json_format.ParseError, RecursionError) as error:
        raise SurveyError(f"{where}: {_reason(line, error)}") from error
    try:
        bounds.check(sweep)
    except BoundsError as error:
        raise SurveyError(f"{where}: {error}") from error
    return sweep


def _read_lines(lines: Iterable[str], name: str) -> Iterator[Record]:
    for number, line in enumerate(lines, start=1):
        if line.strip():
            try:
                yield Record(name, number, from_json(line, f"{name}, line {number}"))
            except SurveyError as error:
                yield Record(name, number, error)


def _reason(line: str, error: Exception) -> str:
    try:
        value = json.loads(line.strip())
    except json.JSONDecodeError as broken:
        return f"not JSON ({broken.msg} at column {broken.colno}): each line holds one Sweep"
    except RecursionError:
        return "not a Sweep: it has more brackets in brackets than any Sweep"
    if isinstance(value, dict):
        known = _names(Sweep)
        for other in (Contour, UnitStatus, ServiceStatus):
            if not value.keys() <= known and value.keys() <= _names(other):
                return f"this is a {other.DESCRIPTOR.name}, and a survey holds Sweeps"
        if unknown := sorted(value.keys() - known):
            fields = ", ".join(Sweep.DESCRIPTOR.fields_by_name)
            return f"not a Sweep: it has {unknown[0]!r}, and the fields of a Sweep are {fields}"
    return f"not a Sweep: {error}"


def _names(message: type[Message]) -> set[str]:
    """Of its fields, as they may be written."""
    return {name for field in message.DESCRIPTOR.fields for name in (field.name, field.json_name)}
