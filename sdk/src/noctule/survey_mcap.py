"""Surveys as MCAP files: one channel per unit, the schema inside, a sweep's start as its time (noctule[cli])."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO

from mcap.reader import NonSeekingReader
from mcap.writer import Writer

from noctule import bounds, bus, keys
from noctule.errors import BoundsError, SurveyError
from noctule.messages_pb2 import Sweep

_SCHEMA = Sweep.DESCRIPTOR.full_name
_ENCODING = "protobuf"


def read_each(path: Path) -> Iterator[Sweep | SurveyError]:
    """The sweeps of an MCAP file in the order in which they were written, an error in place of one with a value beyond
    its bounds; other messages in it are passed over.

    Raises SurveyError where the file was cut or a bit of it has changed.
    """
    number = 0
    try:
        with path.open("rb") as stream:
            for schema, _, message in NonSeekingReader(stream, validate_crcs=True).iter_messages(log_time_order=False):
                if schema is not None and schema.name == _SCHEMA:
                    number += 1
                    yield _decoded(message.data, f"{path}, sweep {number}")
    except OSError as error:
        raise SurveyError(f"{path} can't be read: {error.strerror}") from error
    except Exception as error:  # on broken data the library raises whatever its parts raise
        reason = str(error) or "it ends too early"
        raise SurveyError(f"{path} is not a whole MCAP file of sweeps: {reason}") from error


def _decoded(payload: bytes, where: str) -> Sweep | SurveyError:
    try:
        return bounds.decode(Sweep, payload)
    except BoundsError as error:
        return SurveyError(f"{where}: {error}")


def write(sweeps: Iterable[Sweep], stream: IO[bytes]) -> None:
    """Write a whole MCAP file; a unit's channel is named as the key on which its sweeps were published."""
    writer = Writer(stream)
    writer.start(library="noctule")
    schema = bus.file_descriptor_set(Sweep.DESCRIPTOR.file).SerializeToString()
    schema_id = writer.register_schema(_SCHEMA, _ENCODING, schema)
    channels: dict[str, int] = {}
    for sweep in sweeps:
        topic = keys.sweep(sweep.site, sweep.unit)
        if topic not in channels:
            channels[topic] = writer.register_channel(topic, _ENCODING, schema_id)
        start_ns = sweep.start.ToNanoseconds()
        writer.add_message(channels[topic], start_ns, sweep.SerializeToString(), start_ns)
    writer.finish()
