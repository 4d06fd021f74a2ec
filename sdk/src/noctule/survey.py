"""Files of sweeps: JSON lines of the message Sweep, or MCAP where the file is named so."""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO

from google.protobuf import json_format
from google.protobuf.message import Message

from noctule import bounds
from noctule.errors import BoundsError, SurveyError
from noctule.messages_pb2 import Sweep

MCAP_SUFFIX = ".mcap"


def read(survey: Path | IO[str]) -> Iterator[Sweep]:
    """The sweeps of a file, or of an open text stream of JSON lines, in their order; empty lines are passed over.

    Raises SurveyError, naming the line and what is wrong with it, at the sweep that can't be read.
    """
    if not isinstance(survey, Path):
        yield from _read_lines(survey, getattr(survey, "name", "survey"))
    elif survey.suffix == MCAP_SUFFIX:
        try:
            from noctule import survey_mcap
        except ModuleNotFoundError as error:
            raise SurveyError(f"{survey} can't be read: MCAP needs noctule[cli], install it") from error
        yield from survey_mcap.read(survey)
    else:
        try:
            with survey.open(encoding="utf-8") as lines:
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
    except json_format.ParseError as error:
        raise SurveyError(f"{where}: {_reason(line, error)}") from error
    try:
        bounds.check(sweep)
    except BoundsError as error:
        raise SurveyError(f"{where}: {error}") from error
    return sweep


def _read_lines(lines: Iterable[str], name: str) -> Iterator[Sweep]:
    for number, line in enumerate(lines, start=1):
        if line.strip():
            yield from_json(line, f"{name}, line {number}")


def _reason(line: str, error: json_format.ParseError) -> str:
    try:
        json.loads(line.strip())
    except json.JSONDecodeError as broken:
        return f"not JSON ({broken.msg} at column {broken.colno}): each line holds one Sweep"
    return f"not a Sweep: {error}"
